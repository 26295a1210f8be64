// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/frame_log.hpp"

#include <algorithm>
#include <utility>

namespace cairn {

void FrameLog::add(const nlohmann::json& report) {
  const auto& state = report.at("state").get_ref<const std::string&>();
  ++counts_[state];
  if (state != "fused" && first_reason_.empty()) first_reason_ = report.value("reason", "");
  if (size_++ % every_ != 0) return;
  lines_.push_back(report.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  if (lines_.size() <= kMost) return;
  // Every second one goes.
  for (std::size_t i = 1; 2 * i < lines_.size(); ++i) lines_[i] = std::move(lines_[2 * i]);
  lines_.resize((lines_.size() + 1) / 2);
  every_ *= 2;
}

int FrameLog::count(const std::string& state) const {
  const auto found = counts_.find(state);
  return found == counts_.end() ? 0 : found->second;
}

nlohmann::json FrameLog::kept() const {
  nlohmann::json all = nlohmann::json::array();
  for (const std::string& line : lines_) all.push_back(nlohmann::json::parse(line));
  return all;
}

nlohmann::json FrameLog::save() const {
  return {{"lines", lines_}, {"every", every_}, {"size", size_}, {"counts", counts_}, {"first_reason", first_reason_}};
}

FrameLog FrameLog::from(const nlohmann::json& saved) {
  FrameLog log;
  log.lines_ = saved.at("lines").get<std::vector<std::string>>();
  log.every_ = std::max(1, saved.at("every").get<int>());
  log.size_ = saved.at("size");
  log.counts_ = saved.at("counts").get<std::map<std::string, int>>();
  log.first_reason_ = saved.at("first_reason");
  (void)log.kept();  // nothing else is a report
  return log;
}

}  // namespace cairn
