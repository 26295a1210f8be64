// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Comparison of a finished map with a sample of its frames.
#pragma once
#include <optional>
#include <vector>

#include "cairn/mapping/depth_correction.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "map/frame_samples.hpp"

namespace cairn {

/// A sample and its pose in the world.
struct PlacedSample {
  const FrameSample* sample = nullptr;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
};
/// Returns the samples with a pose. `trajectories`: by recording; `clock_offset`: trajectory times minus frame times,
/// in seconds. With a rolling shutter, only samples of a slow camera: the distortion of fast frames exceeds the error
/// of the map.
[[nodiscard]] std::vector<PlacedSample> placed_samples(const FrameSamples& samples, double readout,
                                                       const std::vector<Trajectory>& trajectories,
                                                       double clock_offset);

/// Agreement of measured depth with the depth of the map along the same rays.
struct DepthAgreement {
  int frames = 0;
  double points = 0;            // number of compared measurements, without edges
  double in_front = 0;          // share of the measurements behind a surface of the map
  double missing = 0;           // share of the measurements without a nearby surface of the map
  double median = 0, rmse = 0;  // meters between measurement and map, for differences below 10 cm
};

/// Depth-dependent tolerance in meters within which a measurement and the map are the same surface.
struct DepthTolerance {
  SensorModel sensor;
  double voxel_size = 0;  // meters
  [[nodiscard]] double at(double depth) const;
};

/// Compares the depth of `samples` with the map along the same rays. Measurements within 1.5 voxels of a hole or of the
/// image's border are left out: the map's surface ends before them until another frame closes the hole.
[[nodiscard]] DepthAgreement compare_depth(const std::vector<Mesh>& parts, const Camera& grid,
                                           const DepthCorrection& correction, const DepthTolerance& tolerance,
                                           const std::vector<PlacedSample>& samples);

}  // namespace cairn
