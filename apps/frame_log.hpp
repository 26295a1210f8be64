// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "reasons.hpp"

namespace cairn::apps {

/// The reports of a run's frames. All are counted; kept are all of the first some thousand, and of a longer run some
/// thousand that lie evenly in it, so that a run of days takes no more memory than one of minutes.
class FrameLog {
 public:
  /// `report` has a "state".
  void add(const nlohmann::json& report);
  [[nodiscard]] int count(const std::string& state) const;
  [[nodiscard]] int size() const { return size_; }
  /// Why frames were skipped.
  [[nodiscard]] const Reasons& skipped() const { return skipped_; }
  /// Why the first frame that was not fused was not; nothing as long as all were.
  [[nodiscard]] const std::optional<std::string>& first_reason() const { return first_reason_; }
  /// The reports that are kept, in their order.
  [[nodiscard]] nlohmann::json kept() const;

  /// To go on with later.
  [[nodiscard]] nlohmann::json save() const;
  /// Throws nlohmann::json::exception for what save() has not made.
  [[nodiscard]] static FrameLog from(const nlohmann::json& saved);

  static constexpr std::size_t kMost = 4096;  // reports

 private:
  /// Every every_-th report, a line each: in one piece, since thousands of small ones that stay would keep memory
  /// between them from going back to the system.
  std::string lines_;
  std::size_t line_count_ = 0;
  int every_ = 1, size_ = 0;
  std::map<std::string, int> counts_;  // by state
  std::optional<std::string> first_reason_;
  Reasons skipped_;
};

}  // namespace cairn::apps
