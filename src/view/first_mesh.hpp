// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>

#include "net/served.hpp"

namespace cairn {

/// Approximate number of triangles of the first mesh, with colors; renders immediately even without a GPU.
inline constexpr std::size_t kFirstTriangles = 80'000;

/// Coarser mesh as .glb, compressed with meshopt, by vertex clustering: the vertices of a grid cell merge into one with
/// their mean position and color, and triangles with two vertices in a cell are removed (Rossignac & Borrel,
/// Multi-resolution 3D approximations for rendering complex scenes, 1993). The cell size follows from `triangles`.
/// Throws std::runtime_error for a file that is not a mesh.
[[nodiscard]] std::string first_mesh(const std::filesystem::path& file, std::size_t triangles = kFirstTriangles);

/// The same for a server, computed in advance.
[[nodiscard]] Served served_first_mesh(const std::filesystem::path& file);

}  // namespace cairn
