// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <set>

#include "base/json_text.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "cairn/parts.hpp"
#include "cairn/quoted.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr double kBad = 0.8;  // of the frames, as for a single run

constexpr const char* kRecordMore =
    "record more between it and the others, from a place that they saw to another, and plan that into the same folder";

std::string reason_of(const PartsPlan& plan, const PartsPlan::Part& part, const std::string& why) {
  const bool is_unjoined = why == kUnjoined;
  return fmt::format("part {} ({}, frames {} to {}) is not in the map: {}{}", part.name,
                     as_utf8(plan.recordings.at(part.recording).name), part.begin, part.end - 1, why,
                     is_unjoined ? fmt::format("; {}", kRecordMore) : std::string());
}

std::vector<JoinedPart> parts_in(const Json& report) {
  std::vector<JoinedPart> parts;
  for (const Json& told : report.at("parts")) {
    JoinedPart part{.name = told.at("name"), .left_out = {}, .recording = told.at("recording")};
    if (!told.at("joined").get<bool>()) part.left_out = told.value("left_out", kUnjoined);
    part.frames = told.value("frames", 0);
    parts.push_back(std::move(part));
  }
  return parts;
}

}  // namespace

Verdict verdict_of(const PartsPlan& plan, const std::vector<JoinedPart>& joined) {
  Verdict verdict;
  std::set<std::size_t> short_of;  // recordings
  std::size_t parts = 0;
  std::int64_t frames = 0, all = 0;
  for (const PartsPlan::Part& part : plan.parts) {
    const auto found = std::ranges::find(joined, part.name, &JoinedPart::name);
    const std::string why = found == joined.end() ? "it was planned afterwards" : found->left_out;
    all += part.end - part.begin;
    if (why.empty()) {
      ++parts;
      frames += part.end - part.begin;
      continue;
    }
    short_of.insert(part.recording);
    verdict.reasons.push_back(reason_of(plan, part, why));
  }
  const double share = all > 0 ? static_cast<double>(frames) / static_cast<double>(all) : 0;
  verdict.words = fmt::format("{} of {} parts are in the map, with {:.0f} % of the frames", parts, plan.parts.size(),
                              std::floor(100 * share));
  if (parts == plan.parts.size()) return verdict;
  verdict.level = share < kBad ? Verdict::Level::bad : Verdict::Level::weak;
  verdict.words += fmt::format("; {} of {} recordings {} missing, whole or in part", short_of.size(),
                               plan.recordings.size(), short_of.size() == 1 ? "is" : "are");
  return verdict;
}

std::optional<std::vector<JoinedPart>> joined_parts(const fs::path& plan) {
  const fs::path file = plan / "report.json";
  if (!fs::exists(file)) return std::nullopt;
  try {
    const auto bytes = read_whole(file);
    return parts_in(parsed_json(bytes));
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: cannot be read ({}); make it again with cairn optimise {}", file.string(),
                                         plain(error.what()), quoted(plan)));
  }
}

}  // namespace cairn
