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
  bool has_size = true;                    // false: the file tells none, the images do
  std::optional<double> depth_scale = {};  // depth image units per metre; none: the file tells none
  std::optional<double> frame_rate = {};   // Hz, of images without times
};

/// Throw std::runtime_error with the value and the range that is allowed.
void check_depth_scale(double units_per_metre);
void check_frame_rate(double hertz);

/// width, height, fx, fy, cx, cy, and perhaps distortion [k1, k2, p1, p2, k3] or these and [k4, k5, k6], or lens:
/// fisheye and distortion [k1, k2, k3, k4]; readout; depth_scale; frame_rate; `colour`: the same keys with translation
/// [x, y, z] and rotation [qx, qy, qz, qw] of colour_from_depth; `sensor`: the name of a SensorModel or its fields;
/// `imu`: rotation [qx, qy, qz, qw] of camera_from_imu. Throws std::runtime_error with file and line, or file and key.
[[nodiscard]] CameraFile read_camera_file(const std::filesystem::path& file);
/// What a user names as a camera: a file as read_intrinsics() takes it or, where there is none, one of known_cameras(),
/// whose size is then not told. Throws std::runtime_error for what is neither.
[[nodiscard]] CameraFile camera_named(const std::filesystem::path& file_or_name);
/// The same for images of these cameras, to whose sizes a known camera is scaled. Throws for other sizes.
[[nodiscard]] Rig rig_named(const std::filesystem::path& file_or_name, const Rig& images);
/// The file's text.
[[nodiscard]] std::string camera_file_text(const CameraFile& file);

}  // namespace cairn
