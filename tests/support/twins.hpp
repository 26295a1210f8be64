// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reference implementations of the kernels: plain loops on the CPU.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "alignment/align.hpp"
#include "cairn/mapping/camera.hpp"
#include "cairn/mapping/options.hpp"
#include "volume/volume.hpp"

namespace cairn::twin {

struct Filtered {
  std::vector<float> clean, smooth;
};
[[nodiscard]] Filtered filter(const std::vector<float>& depth, const Camera& camera, const SurfaceOptions& options);
[[nodiscard]] std::vector<float> half(const std::vector<float>& fine, const Camera& fine_camera);
/// Normals by pixel; zero where undefined.
[[nodiscard]] std::vector<Eigen::Vector3f> normals(const std::vector<float>& depth, const Camera& camera);

struct Voxel {
  float distance = 0, weight = 0;  // distance in truncations
  Eigen::Vector3f color = Eigen::Vector3f::Zero();
  float color_weight = 0;
};
/// Integrates one frame into one voxel.
void integrate(Voxel& voxel, const Eigen::Vector3d& point_in_camera, const std::vector<float>& depth,
               const std::vector<std::uint32_t>& color, const Camera& camera, const FuseOptions& options);

/// Voxels of a brick passed by one frame's rays: all four pixels of the quad around the voxel's projection have a depth
/// greater than the voxel's by more than the truncation.
[[nodiscard]] BrickBits free_voxels(const Brick& brick, const std::vector<float>& depth, const Camera& camera,
                                    const Eigen::Isometry3d& submap_from_camera, const FuseOptions& options);

/// Mean of submaps at one voxel of the world; each a map and submap_from_world in meters.
[[nodiscard]] Voxel merge(const Eigen::Vector3i& voxel,
                          const std::vector<std::pair<const BrickTree*, Eigen::Isometry3d>>& submaps,
                          const FuseOptions& options);

/// Corners of all triangles of a map, voxels as in BrickTree; `triangles` x 3, sorted by the position of their cell.
[[nodiscard]] std::vector<Eigen::Vector3f> polygonize(const BrickTree& tree, const FuseOptions& options);

/// Bricks along the truncation bands of every `stride`-th measurement, from (phase_x, phase_y) on, sorted.
[[nodiscard]] std::vector<Brick> bands(const std::vector<float>& depth, const Camera& camera,
                                       const Eigen::Isometry3d& submap_from_camera, const FuseOptions& options,
                                       int stride, int phase_x, int phase_y);

/// Luminance in 0..1; -1 if over- or underexposed.
[[nodiscard]] std::vector<double> brightness(const std::vector<std::uint32_t>& color);
struct Photometric {
  double seen = 0, rmse = 0, share = 0;
};
/// Residuals of live brightness against a keyframe, weighted by a t-distribution of scale `sigma`.
[[nodiscard]] Photometric photometric(const std::vector<double>& live, const std::vector<float>& live_depth,
                                      const std::vector<double>& key, const std::vector<float>& key_depth,
                                      const Camera& camera, const Eigen::Isometry3d& key_from_live, double sigma);

/// Decodes the second word of a point image; the inverse of pack_normal in shaders/types.h.
[[nodiscard]] Eigen::Vector3f unpack_normal(std::uint32_t code);

}  // namespace cairn::twin
