// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace cairn {

/// Triangles in the map's world frame (z forward of the first camera, y down, or the frame of the given poses).
/// `normals` and `colours` are empty or of the size of `positions`. Triangles are counter-clockwise seen from outside.
struct Mesh {
  std::vector<Eigen::Vector3f> positions;            // metres
  std::vector<Eigen::Vector3f> normals;              // unit length, away from the solid
  std::vector<std::array<std::uint8_t, 4>> colours;  // R, G, B, 255 (sRGB)
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Writes by extension: .glb, .gltf (with .bin beside it) or .ply (binary). glTF is turned to y-up, and says so in
/// `asset.extras`; PLY stays in the world frame. Whole or not at all. Throws std::runtime_error for an unknown
/// extension or an unwritable place.
void write_mesh(const std::filesystem::path& file, const Mesh& mesh);

/// Reads what write_mesh wrote, back in the world frame; also other systems' PLY (ascii or binary) and glTF triangles.
[[nodiscard]] Mesh read_mesh(const std::filesystem::path& file);

}  // namespace cairn
