// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Image features with their positions in space.
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <vector>

#include "cairn/mapping/camera.hpp"

namespace cairn {

struct Features {
  std::vector<Eigen::Vector2d> rays;                      // at z = 1, without distortion
  std::vector<Eigen::Vector3d> points;                    // meters, camera frame; z = 0: no depth
  std::vector<std::array<std::uint8_t, 32>> descriptors;  // ORB (Rublee et al. 2011)
};

/// Features that another thread extracts.
using FutureFeatures = std::shared_future<std::shared_ptr<const Features>>;
[[nodiscard]] FutureFeatures ready(Features features);
/// Waits for features. None if their extraction failed.
[[nodiscard]] std::shared_ptr<const Features> features_or_none(const FutureFeatures& features);

/// Extracts oriented FAST corners with binary descriptors. `color` (bytes R, G, B, 255) and `depth` (meters) are of
/// the camera's size. Without color, extracts corners from the shaded surface.
[[nodiscard]] Features extract_features(const std::vector<std::uint32_t>& color, const std::vector<float>& depth,
                                        const Camera& camera);

struct PnpPose {
  Eigen::Isometry3d known_from_seen = Eigen::Isometry3d::Identity();
  int inliers = 0;
};
/// Pose of the camera of `seen` relative to the camera of `known`: mutual nearest descriptors, then perspective-n-point
/// in a RANSAC loop of fixed seed (Fischler & Bolles 1981; Lepetit et al. 2009). Empty with fewer than 20 inliers.
[[nodiscard]] std::optional<PnpPose> solve_pnp(const Features& known, const Features& seen, const Camera& camera);

/// Candidates for the true focal length in units of the camera's.
constexpr std::array<double, 9> kFocalScales{0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.15, 1.2};
/// Mean squared reprojection error in pixels between features of `seen` and projected features of `known`, for each
/// focal length with its best pose. The camera must have turned between the two. Empty with too few inliers.
[[nodiscard]] std::vector<double> focal_costs(const Features& known, const Features& seen, const Camera& camera);

}  // namespace cairn
