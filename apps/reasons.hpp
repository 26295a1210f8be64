// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace cairn::apps {

/// Why frames were left out: one line a reason instead of one a frame.
class Reasons {
 public:
  /// `reason`: "PLACE: WHY", or why alone. Those that differ in their place and their numbers alone are one.
  void add(int frame, const std::string& reason);
  [[nodiscard]] bool empty() const { return all_.empty(); }
  /// "17 of 400 frames skipped: holds no measurement (first: frame 12, depth/12.png)"; the most frequent first.
  [[nodiscard]] std::vector<std::string> lines(int frames, const char* what) const;

  [[nodiscard]] nlohmann::json save() const;
  /// Throws nlohmann::json::exception for what save() has not made.
  [[nodiscard]] static Reasons from(const nlohmann::json& saved);

 private:
  struct Reason {
    std::string key, why, place;  // of the first
    int frame = 0, count = 0;
  };
  std::vector<Reason> all_;
};

}  // namespace cairn::apps
