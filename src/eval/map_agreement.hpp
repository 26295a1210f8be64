// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A finished map against a sample of the frames it was made from.
#pragma once
#include <optional>
#include <vector>

#include "cairn/depth_correction.hpp"
#include "cairn/mesh.hpp"
#include "cairn/trajectory.hpp"
#include "eval/frame_samples.hpp"

namespace cairn {

/// A sample and its pose in the world.
struct PlacedSample {
  const FrameSample* sample = nullptr;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
};
/// Samples whose frame has a pose. `trajectories`: by recording; `clock_offset`: seconds that their times are ahead of
/// the frames'. With a rolling shutter, samples of a slow camera alone: fast ones are bent by more than the map errs.
[[nodiscard]] std::vector<PlacedSample> placed_samples(const FrameSamples& samples, double readout,
                                                       const std::vector<Trajectory>& trajectories,
                                                       double clock_offset);

/// Agreement of measured depth with the depth of the map along the same rays.
struct DepthAgreement {
  int frames = 0;
  double points = 0;            // measurements that were compared, edges left out
  double in_front = 0;          // share whose ray passes through a surface of the map before it ends
  double missing = 0;           // share with no surface of the map near by
  double median = 0, rmse = 0;  // meters between measurement and map, where these are within 10 cm
};

/// `tolerance`: meters by depth, within which a measurement and the map are the same surface.
struct DepthTolerance {
  SensorModel sensor;
  double voxel_size = 0;  // meters
  [[nodiscard]] double at(double depth) const;
};

[[nodiscard]] DepthAgreement compare_depth(const std::vector<Mesh>& parts, const Camera& grid,
                                           const DepthCorrection& correction, const DepthTolerance& tolerance,
                                           const std::vector<PlacedSample>& samples);

}  // namespace cairn
