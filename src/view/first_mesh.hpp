// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>

namespace cairn {

/// What a page shows until the mesh itself is there: about so many triangles, with colours, drawn at once also where
/// no GPU helps.
inline constexpr std::size_t kFirstTriangles = 80'000;

/// The .glb of a coarser mesh: vertices that lie in one cell of a grid become one, with their mean place and colour,
/// and triangles with two of them in one cell are gone (Rossignac & Borrel, Multi-resolution 3D approximations for
/// rendering complex scenes, 1993). The grid is as fine as `triangles` allow. Throws std::runtime_error for a file that
/// is no mesh.
[[nodiscard]] std::string first_mesh(const std::filesystem::path& file, std::size_t triangles = kFirstTriangles);

}  // namespace cairn
