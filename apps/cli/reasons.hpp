// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace cairn::apps {

/// Reasons for skipped frames, one line per reason instead of per frame.
class Reasons {
 public:
  /// `reason`: "PLACE: WHY", or only WHY. Reasons that differ only in place and numbers are merged.
  void add(int frame, const std::string& reason);
  [[nodiscard]] bool empty() const { return all_.empty(); }
  /// "17 of 400 frames skipped: holds no measurement (first: frame 12, depth/12.png)", sorted by frequency.
  [[nodiscard]] std::vector<std::string> lines(int frames, const char* what) const;

  [[nodiscard]] nlohmann::json save() const;
  /// Throws nlohmann::json::exception for input not produced by save().
  [[nodiscard]] static Reasons from(const nlohmann::json& saved);

 private:
  struct Reason {
    std::string key, why, place;  // of the first frame
    int frame = 0, count = 0;
  };
  std::vector<Reason> all_;
};

}  // namespace cairn::apps
