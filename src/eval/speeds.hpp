// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <iosfwd>
#include <optional>

#include "cairn/options.hpp"
#include "cairn/reports.hpp"

namespace cairn {

/// The fastest steps of a track between frames that follow each other, both with a pose.
class Speeds {
 public:
  Speeds() = default;
  explicit Speeds(const MotionOptions& motion) : motion_(motion) {}
  /// The next frame does not follow the last one.
  void begin() { last_.reset(); }
  /// `interval`: usual seconds from frame to frame: stamps that jitter make no speed.
  void add(const FrameReport& report, bool has_pose, double interval);

  struct Peak {
    double value = 0, timestamp = 0;  // m/s or rad/s; seconds
    int steps = 0;                    // beyond the limit
  };
  [[nodiscard]] const Peak& speed() const { return speed_; }
  [[nodiscard]] const Peak& turn() const { return turn_; }
  [[nodiscard]] double speed_limit() const;  // m/s
  [[nodiscard]] double turn_limit() const;   // rad/s
  [[nodiscard]] bool has_steps() const { return steps_ > 0; }

  void save(std::ostream& out) const;
  /// False where save() did not write that: all is as it was.
  bool restore(std::istream& in);

 private:
  MotionOptions motion_;
  Peak speed_, turn_;
  int steps_ = 0;
  struct Last {
    double timestamp;
    Eigen::Isometry3d tracked_from_camera;
  };
  std::optional<Last> last_;
};

}  // namespace cairn
