// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <vector>

#include "cairn/frame.hpp"
#include "cairn/pose.hpp"

namespace cairn {

/// From the depth camera as it is so many seconds after a frame's time to itself at that time.
using MotionAt = std::function<Eigen::Isometry3d(double delay)>;

/// That of a constant velocity in its own frame, rad/s and m/s.
[[nodiscard]] MotionAt at_velocity(const Vector6d& velocity);

/// Turns the images of a rolling shutter into those that the cameras would have taken at once, at the frame's time:
/// each row is moved by how the camera moves until its own time (Forssén & Ringaby 2010, with depth that is measured
/// instead of a rotation alone). Lens and size stay.
class GlobalShutter {
 public:
  explicit GlobalShutter(const Rig& rig);
  /// Whether there is anything to do.
  [[nodiscard]] bool is_needed() const { return rig_.depth.readout > 0 || rig_.colour_view().readout > 0; }
  [[nodiscard]] Frame operator()(const Frame& frame, const MotionAt& motion) const;
  /// How far apart two motions put the first or the last row, pixels at a metre's distance.
  [[nodiscard]] double difference(const MotionAt& a, const MotionAt& b) const;

 private:
  /// A camera's undistorted rays by pixel.
  struct Rays {
    Camera camera;
    std::vector<Eigen::Vector2f> at;  // empty: without a lens
    explicit Rays(const Camera& c);
    [[nodiscard]] Eigen::Vector2d of(const Eigen::Vector2d& pixel) const;
    [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& point) const;
  };
  class Warp;
  Rig rig_;
  Rays depth_, colour_;
};

}  // namespace cairn
