// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Camera files of SLAM and structure-from-motion programs.
#pragma once
#include <filesystem>
#include <optional>
#include <vector>

#include "io/camera_file.hpp"

namespace YAML {
class Node;
}

namespace cairn {

/// Reads settings of ORB-SLAM2 (Mur-Artal & Tardos 2017) and ORB-SLAM3 (Campos et al. 2021): `Camera.fx` or
/// `Camera1.fx` and so on; empty for YAML without such a key. Throws std::runtime_error with the missing or invalid
/// key.
[[nodiscard]] std::optional<CameraFile> orb_slam_camera(const YAML::Node& yaml);

/// Reads the single camera of COLMAP's cameras.txt (Schonberger & Frahm 2016). Models with Brown-Conrady or fisheye
/// distortion map exactly; other models, and files with differing cameras, throw std::runtime_error without the file
/// name.
[[nodiscard]] CameraFile colmap_camera(const std::filesystem::path& file);

/// Returns a folder's camera files of SLAM and structure-from-motion programs, in order of precedence: COLMAP's
/// cameras.txt, then YAML with ORB-SLAM keys.
[[nodiscard]] std::vector<std::filesystem::path> other_camera_files(const std::filesystem::path& folder);

}  // namespace cairn
