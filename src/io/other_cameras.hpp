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

/// Settings of ORB-SLAM2 (Mur-Artal & Tardos 2017) and ORB-SLAM3 (Campos et al. 2021): `Camera.fx` or `Camera1.fx` and
/// so on; nothing for YAML without such a key. Throws std::runtime_error with the key that is missing or wrong.
[[nodiscard]] std::optional<CameraFile> orb_slam_camera(const YAML::Node& yaml);

/// The one camera of COLMAP's cameras.txt (Schonberger & Frahm 2016). Its models with Brown's or the fisheye lens map
/// exactly; other models, and files of cameras that differ, throw std::runtime_error without the file's name.
[[nodiscard]] CameraFile colmap_camera(const std::filesystem::path& file);

/// Files of a folder that only such programs write, in the order in which they count: COLMAP's cameras.txt, and YAML
/// with ORB-SLAM's keys.
[[nodiscard]] std::vector<std::filesystem::path> other_camera_files(const std::filesystem::path& folder);

}  // namespace cairn
