// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "cli/reasons.hpp"

namespace cairn::apps {

/// Reports of a run's frames. Counts all and stores at most some thousand: all frames of a short run, an even subset of
/// a long run, so that memory does not grow with the length of a run.
class FrameLog {
 public:
  /// `report` has a "state".
  void add(const nlohmann::json& report);
  /// Replaces the state of all frames with state `from`.
  void replace(const std::string& from, const std::string& to);
  [[nodiscard]] int count(const std::string& state) const;
  [[nodiscard]] int size() const { return size_; }
  /// Reasons for skipped frames.
  [[nodiscard]] const Reasons& skipped() const { return skipped_; }
  /// Reason of the first frame that was not fused, if any.
  [[nodiscard]] const std::optional<std::string>& first_reason() const { return first_reason_; }
  /// The stored reports, in order.
  [[nodiscard]] nlohmann::json kept() const;

  /// State for a resumed run.
  [[nodiscard]] nlohmann::json save() const;
  /// Throws nlohmann::json::exception for input not produced by save().
  [[nodiscard]] static FrameLog from(const nlohmann::json& saved);

  static constexpr std::size_t kMaxReports = 4096;  // reports

 private:
  /// Every every_-th report, one line each. A single string, since thousands of small allocations would keep the memory
  /// between them from returning to the system.
  std::string lines_;
  std::size_t line_count_ = 0;
  int every_ = 1, size_ = 0;
  std::map<std::string, int> counts_;  // by state
  std::optional<std::string> first_reason_;
  Reasons skipped_;
};

}  // namespace cairn::apps
