// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// camera.yaml: what a camera is, beside its images or given by hand.
#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>

#include "cairn/camera.hpp"

namespace cairn {

/// A colour camera that looks from beside the depth camera.
struct ColourCamera {
  Camera camera;
  Eigen::Isometry3d colour_from_depth = Eigen::Isometry3d::Identity();
};

struct CameraFile {
  Camera camera;                       // of the depth images
  double depth_scale = 5000.0;         // depth image units per metre
  std::optional<ColourCamera> colour;  // none: it shares the depth camera's view
};

/// Throws std::runtime_error with the value and the range that is allowed.
void check_depth_scale(double units_per_metre);

/// width, height, fx, fy, cx, cy, and perhaps distortion [k1, k2, p1, p2, k3], depth_scale and `colour`: the same keys
/// with translation [x, y, z] and rotation [qx, qy, qz, qw] of colour_from_depth. Throws std::runtime_error with file
/// and line, or file and key.
[[nodiscard]] CameraFile read_camera_file(const std::filesystem::path& file);
/// The file's text for a camera that colour and depth share.
[[nodiscard]] std::string camera_file_text(const Camera& camera, double depth_scale);

}  // namespace cairn
