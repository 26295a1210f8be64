// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The camera of a folder of images, from the files that people have: camera.yaml, JSON of Open3D, librealsense and
// Record3D, a matrix as text, ROS' camera_info, and those of other_cameras.hpp.
#pragma once
#include <filesystem>
#include <optional>

#include "io/camera_file.hpp"

namespace YAML {
class Node;
}

namespace cairn {

/// A camera as `camera_matrix: {data: [...]}` and its like tell, of ROS' camera_calibration and RTAB-Map, or as K and D
/// of a camera_info. Throws std::runtime_error and YAML::Exception.
[[nodiscard]] Camera camera_of_ros(const YAML::Node& yaml);

struct Intrinsics {
  CameraFile camera;       ///< its size is not checked where the file tells none
  bool is_open3d = false;  ///< has Open3D's intrinsic_matrix
};
/// The first file of a known name in the folder; nothing where there is none.
[[nodiscard]] std::optional<std::filesystem::path> intrinsics_file(const std::filesystem::path& folder);
/// Throws std::runtime_error with the file and what is wrong in it.
[[nodiscard]] Intrinsics read_intrinsics(const std::filesystem::path& file);

/// Files beside the images that may be meant for a camera and are not taken, with what is wrong with them, as a clause
/// that ends with "; "; empty: none.
[[nodiscard]] std::string passed_over_cameras(const std::filesystem::path& folder);

/// Where to write what, as one clause of a message: the smallest camera.yaml, and what else `--camera` takes.
[[nodiscard]] std::string how_to_tell_the_camera(const std::filesystem::path& folder, const Camera& like);

}  // namespace cairn
