// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Camera parameters in camera.yaml, next to the images or given by the user.
#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "cairn/mapping/rig.hpp"

namespace cairn {

struct CameraFile {
  Rig rig;
  bool has_size = true;                    // false: the file has no size, the images define it
  std::optional<double> depth_scale = {};  // depth image units per meter; empty: not in the file
  std::optional<double> frame_rate = {};   // Hz, of images without times
};

/// Throw std::runtime_error with the value and the allowed range.
void check_depth_scale(double units_per_meter);
void check_frame_rate(double hertz);

/// Reads width, height, fx, fy, cx, cy, and optionally distortion [k1, k2, p1, p2, k3] followed by [k4, k5, k6], or
/// lens: fisheye and distortion [k1, k2, k3, k4]; readout; depth_scale; frame_rate; `color`: the same keys with
/// translation [x, y, z] and rotation [qx, qy, qz, qw] of color_from_depth; `sensor`: the name of a SensorModel or its
/// fields; `imu`: rotation [qx, qy, qz, qw] of camera_from_imu. Throws std::runtime_error with file and line, or file
/// and key.
[[nodiscard]] CameraFile read_camera_file(const std::filesystem::path& file);
/// The same for the text of a file, YAML or JSON; errors name the key.
[[nodiscard]] CameraFile camera_of_text(const std::string& yaml);
/// Resolves a camera given by the user: a file for read_intrinsics() or, if no such file exists, a name from
/// known_cameras(), then without a size. Throws std::runtime_error if neither matches.
[[nodiscard]] CameraFile camera_named(const std::filesystem::path& file_or_name);
/// The same for images of known size: a known camera is scaled to `images`. Throws for other sizes.
[[nodiscard]] Rig rig_named(const std::filesystem::path& file_or_name, const Rig& images);
/// Serializes a camera file to YAML.
[[nodiscard]] std::string camera_file_text(const CameraFile& file);

}  // namespace cairn
