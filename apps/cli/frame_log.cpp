// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/frame_log.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include "cli/json_text.hpp"

namespace cairn::apps {
namespace {

void for_each_line(std::string_view lines, const auto& visit) {
  for (std::size_t end = 0; (end = lines.find('\n')) != lines.npos; lines.remove_prefix(end + 1))
    visit(lines.substr(0, end));
}

}  // namespace

void FrameLog::add(const nlohmann::json& report) {
  const auto& state = report.at("state").get_ref<const std::string&>();
  ++counts_[state];
  if (state != "fused" && !first_reason_ && report.contains("reason"))
    first_reason_ = report["reason"].get<std::string>();
  if (state == "skipped" && report.contains("reason"))
    skipped_.add(report.value("index", size_), report["reason"].get<std::string>());
  if (size_++ % every_ != 0) return;
  lines_ += report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
  if (++line_count_ <= kMaxReports) return;
  std::string kept;
  std::size_t number = 0;
  line_count_ = 0;
  for_each_line(lines_, [&](std::string_view line) {
    if (number++ % 2 == 1) return;  // drop every second report
    kept.append(line) += '\n';
    ++line_count_;
  });
  lines_ = std::move(kept);
  every_ *= 2;
}

void FrameLog::replace(const std::string& from, const std::string& to) {
  counts_[to] += std::exchange(counts_[from], 0);
  std::string lines;
  for_each_line(lines_, [&](std::string_view line) {
    auto report = parsed_json(line);
    if (report.at("state") == from) report["state"] = to;
    lines += report.dump() + '\n';
  });
  lines_ = std::move(lines);
}

int FrameLog::count(const std::string& state) const {
  const auto found = counts_.find(state);
  return found == counts_.end() ? 0 : found->second;
}

nlohmann::json FrameLog::kept() const {
  nlohmann::json all = nlohmann::json::array();
  for_each_line(lines_, [&](std::string_view line) { all.push_back(parsed_json(line)); });
  return all;
}

nlohmann::json FrameLog::save() const {
  nlohmann::json saved{{"lines", lines_}, {"every", every_}, {"size", size_}, {"counts", counts_}};
  if (!skipped_.empty()) saved["skipped"] = skipped_.save();
  if (first_reason_) saved["first_reason"] = *first_reason_;
  return saved;
}

FrameLog FrameLog::from(const nlohmann::json& saved) {
  FrameLog log;
  log.lines_ = saved.at("lines").get<std::string>();
  log.every_ = std::max(1, saved.at("every").get<int>());
  log.size_ = saved.at("size");
  log.counts_ = saved.at("counts").get<std::map<std::string, int>>();
  if (saved.contains("first_reason")) log.first_reason_ = saved["first_reason"].get<std::string>();
  if (saved.contains("skipped")) log.skipped_ = Reasons::from(saved["skipped"]);
  log.line_count_ = log.kept().size();  // throws if a line is not a report
  return log;
}

}  // namespace cairn::apps
