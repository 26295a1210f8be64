// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/reasons.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace cairn::apps {
namespace {

constexpr std::size_t kMaxReasons = 8;  // reasons; all further reasons share an extra entry

std::string key_of(const std::string& why) {
  std::string key;
  for (const char c : why) {
    const bool digit = c >= '0' && c <= '9';
    if (!digit || key.empty() || key.back() != '#') key += digit ? '#' : c;
  }
  return key;
}

}  // namespace

void Reasons::add(int frame, const std::string& reason) {
  const std::size_t colon = reason.find(": ");
  const bool has_place = colon != reason.npos && reason.find_first_of("./") < colon;
  Reason added{.why = has_place ? reason.substr(colon + 2) : reason,
               .place = has_place ? reason.substr(0, colon) : "",
               .frame = frame};
  added.key = key_of(added.why);
  auto it = std::find_if(all_.begin(), all_.end(), [&](const Reason& r) { return r.key == added.key; });
  if (it == all_.end() && all_.size() >= kMaxReasons) {
    added.key = added.why = "other reasons, see report.json";
    it = std::find_if(all_.begin(), all_.end(), [&](const Reason& r) { return r.key == added.key; });
  }
  if (it == all_.end()) it = all_.insert(all_.end(), std::move(added));
  ++it->count;
}

std::vector<std::string> Reasons::lines(int frames, const char* what) const {
  std::vector<Reason> sorted = all_;
  std::stable_sort(sorted.begin(), sorted.end(), [](const Reason& a, const Reason& b) { return a.count > b.count; });
  std::vector<std::string> lines;
  lines.reserve(sorted.size());
  for (const Reason& r : sorted)
    lines.push_back(fmt::format("{} of {} frames {}: {} ({}frame {}{})", r.count, frames, what, r.why,
                                r.count > 1 ? "first: " : "", r.frame, r.place.empty() ? "" : ", " + r.place));
  return lines;
}

nlohmann::json Reasons::save() const {
  nlohmann::json saved = nlohmann::json::array();
  for (const Reason& r : all_)
    saved.push_back({{"why", r.why}, {"place", r.place}, {"frame", r.frame}, {"count", r.count}});
  return saved;
}

Reasons Reasons::from(const nlohmann::json& saved) {
  Reasons reasons;
  for (const auto& r : saved)
    reasons.all_.push_back(
        {key_of(r.at("why").get<std::string>()), r.at("why"), r.at("place"), r.at("frame"), r.at("count")});
  return reasons;
}

}  // namespace cairn::apps
