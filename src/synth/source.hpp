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

struct SyntheticOptions {
  std::string scene = "room";
  int frames = 300;
  bool kinect_noise = false;
  std::uint64_t seed = 1;
  Trajectory path;          // world_from_camera; empty: the scene's own hand-held-like path
  bool with_poses = false;  // frames carry their true pose
  int device = -1;
};

/// A scene rendered on the fly, on a device of its own. Throws std::runtime_error for an unknown scene.
[[nodiscard]] std::unique_ptr<Source> open_synthetic(const SyntheticOptions& options);

/// world_from_camera of a synthetic recording; nothing beyond the end of a given path.
[[nodiscard]] std::optional<Eigen::Isometry3d> synthetic_pose(const Scene& scene, const Trajectory& path,
                                                              double seconds);

}  // namespace cairn
