// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// camera.yaml: what a camera is, beside its images or given by hand.
#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "cairn/rig.hpp"

namespace cairn {

struct CameraFile {
  Rig rig;
  std::optional<double> depth_scale = 5000.0;  // depth image units per metre; none is written of one that is not known
};

/// Throws std::runtime_error with the value and the range that is allowed.
void check_depth_scale(double units_per_metre);

/// width, height, fx, fy, cx, cy, and perhaps distortion [k1, k2, p1, p2, k3] or these and [k4, k5, k6], or lens:
/// fisheye and distortion [k1, k2, k3, k4]; readout; depth_scale; `colour`: the same keys with translation [x, y, z]
/// and rotation [qx, qy, qz, qw] of colour_from_depth; `sensor`: the name of a SensorModel or its fields; `imu`:
/// rotation [qx, qy, qz, qw] of camera_from_imu. Throws std::runtime_error with file and line, or file and key.
[[nodiscard]] CameraFile read_camera_file(const std::filesystem::path& file);
/// The file's text.
[[nodiscard]] std::string camera_file_text(const CameraFile& file);

}  // namespace cairn
