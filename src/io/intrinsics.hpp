// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Camera of an image folder, from common files: camera.yaml, JSON of Open3D, librealsense and Record3D, a matrix as
// text, ROS camera_info, and the formats of other_cameras.hpp.
#pragma once
#include <filesystem>
#include <optional>

#include "io/camera_file.hpp"

namespace YAML {
class Node;
}

namespace cairn {

/// Reads a camera in the form `camera_matrix: {data: [...]}`, written by ROS' camera_calibration and RTAB-Map, or as K
/// and D of a camera_info. Throws std::runtime_error and YAML::Exception.
[[nodiscard]] Camera camera_of_ros(const YAML::Node& yaml);

struct Intrinsics {
  CameraFile camera;       ///< size not checked if missing from the file
  bool is_open3d = false;  ///< has Open3D's intrinsic_matrix
};
/// Returns the first file with a known name in the folder; empty if there is none.
[[nodiscard]] std::optional<std::filesystem::path> intrinsics_file(const std::filesystem::path& folder);
/// Reads a camera file. Throws std::runtime_error with the file and the error in it.
[[nodiscard]] Intrinsics read_intrinsics(const std::filesystem::path& file);

/// Lists unused files next to the images that may be meant as a camera, with their errors, as a clause ending in "; ";
/// empty if there are none.
[[nodiscard]] std::string unused_cameras_in(const std::filesystem::path& folder);

/// Explains in one clause how to provide the camera: path and content of a minimal camera.yaml, and the alternatives of
/// `--camera`.
[[nodiscard]] std::string how_to_give_the_camera(const std::filesystem::path& folder, const Camera& example);

}  // namespace cairn
