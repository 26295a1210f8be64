// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <iosfwd>
#include <optional>

#include "cairn/mapping/options.hpp"
#include "cairn/mapping/reports.hpp"

namespace cairn {

/// Highest speeds of a trajectory between consecutive frames with poses.
class Speeds {
 public:
  Speeds() = default;
  explicit Speeds(const MotionOptions& motion) : motion_(motion) {}
  /// Starts a new sequence: the next frame does not follow the last.
  void begin() { last_.reset(); }
  /// `interval`: usual frame interval in seconds, a lower bound that keeps timestamp jitter from raising the speed.
  void add(const FrameReport& report, bool has_pose, double interval);

  struct Peak {
    double value = 0, timestamp = 0;  // m/s or rad/s; seconds
    int steps = 0;                    // number of steps above the limit
  };
  [[nodiscard]] const Peak& speed() const { return speed_; }
  [[nodiscard]] const Peak& turn() const { return turn_; }
  [[nodiscard]] double speed_limit() const;  // m/s
  [[nodiscard]] double turn_limit() const;   // rad/s
  [[nodiscard]] bool has_steps() const { return steps_ > 0; }

  void save(std::ostream& out) const;
  /// Returns false for input not written by save(), without changes.
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
