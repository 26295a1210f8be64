// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "cairn/frame.hpp"
#include "cairn/scene.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

/// How the camera moves through a scene.
class SyntheticPath {
 public:
  /// `recorded`: world_from_camera in a world with z up, as TUM's; empty: the scene's own hand-held-like path. The
  /// first `seconds` of it are put into the middle of the scene, their longer side along x.
  SyntheticPath(Scene scene, Trajectory recorded, double seconds);
  /// world_from_camera; nothing beyond the path's end or in a gap of more than 2.5 s. Shorter ones are passed at
  /// constant velocity.
  [[nodiscard]] std::optional<Eigen::Isometry3d> pose(double seconds) const;
  /// What an accelerometer in the camera measures: see Frame::acceleration.
  [[nodiscard]] Eigen::Vector3d acceleration(double seconds) const;

 private:
  Scene scene_;
  Trajectory recorded_;  // in the scene
};

struct SyntheticOptions {
  std::string scene = "room";
  int first = 0, frames = 300;  // from the first to the one before frame number `frames`
  bool kinect_noise = false;
  std::uint64_t seed = 1;
  bool with_poses = false;  // frames carry their true pose
  int device = -1;
};

/// A scene rendered on the fly, on a device of its own. Throws std::runtime_error for an unknown scene.
[[nodiscard]] std::unique_ptr<Source> open_synthetic(const SyntheticOptions& options);

}  // namespace cairn
