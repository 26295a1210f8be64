// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Plain-loop twins of the kernels: slow, obvious, and on the CPU.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <vector>

#include "cairn/camera.hpp"
#include "cairn/options.hpp"
#include "track/icp.hpp"
#include "volume/volume.hpp"

namespace cairn::twin {

struct Filtered {
  std::vector<float> clean, smooth;
};
[[nodiscard]] Filtered filter(const std::vector<float>& depth, const Camera& camera, const SurfaceOptions& options);
[[nodiscard]] std::vector<float> half(const std::vector<float>& fine, const Camera& fine_camera);
/// Depth and normal by pixel; a zero normal where there is none.
[[nodiscard]] std::vector<Eigen::Vector3f> normals(const std::vector<float>& depth, const Camera& camera);

struct Voxel {
  float distance = 0, weight = 0;  // truncations
  Eigen::Vector3f colour = Eigen::Vector3f::Zero();
  float colour_weight = 0;
};
/// One frame into one voxel.
void integrate(Voxel& voxel, const Eigen::Vector3d& point_in_camera, const std::vector<float>& depth,
               const std::vector<std::uint32_t>& colour, const Camera& camera, const FuseOptions& options);

/// Unpacks a point image's second word; the inverse of pack_normal in shaders/types.h.
[[nodiscard]] Eigen::Vector3f unpack_normal(std::uint32_t code);

}  // namespace cairn::twin
