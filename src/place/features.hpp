// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Corners of an image that can be found again, with their places in space.
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/camera.hpp"

namespace cairn {

struct Features {
  std::vector<Eigen::Vector2d> rays;                      // at z = 1, without distortion
  std::vector<Eigen::Vector3d> points;                    // metres, camera frame; z = 0: no depth
  std::vector<std::array<std::uint8_t, 32>> descriptors;  // ORB (Rublee et al. 2011)
};

/// Oriented FAST corners with binary descriptors. `colour` (bytes R, G, B, 255) and `depth` (metres) are of the
/// camera's size. Without colour, corners of the surface as a light from the side would show it.
[[nodiscard]] Features extract_features(const std::vector<std::uint32_t>& colour, const std::vector<float>& depth,
                                        const Camera& camera);

struct PnpPose {
  Eigen::Isometry3d known_from_seen = Eigen::Isometry3d::Identity();
  int inliers = 0;
};
/// Where the camera that saw `seen` was, from corners whose place `known` tells: mutual nearest descriptors, then
/// perspective-n-point in a RANSAC loop of fixed seed (Fischler & Bolles 1981; Lepetit et al. 2009). Nothing when fewer
/// than 20 agree.
[[nodiscard]] std::optional<PnpPose> solve_pnp(const Features& known, const Features& seen, const Camera& camera);

/// Candidates for the true focal length in units of the camera's.
constexpr std::array<double, 9> kFocalScales{0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.15, 1.2};
/// Mean squared distance, in pixels, between corners of `seen` and where `known`'s project to with each focal length
/// and the pose that suits it best. The camera must have turned between the two. Empty when too few corners agree.
[[nodiscard]] std::vector<double> focal_costs(const Features& known, const Features& seen, const Camera& camera);

}  // namespace cairn
