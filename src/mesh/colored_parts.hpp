// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <vector>

#include "cairn/mapping/mesh.hpp"

namespace cairn {

/// Replaces the texture by vertex colors sampled from it. A mesh without a texture is unchanged.
void take_colors(Mesh& mesh);

/// Parts of a mesh file, with textures replaced by vertex colors.
[[nodiscard]] std::vector<Mesh> colored_parts(const std::filesystem::path& file);

}  // namespace cairn
