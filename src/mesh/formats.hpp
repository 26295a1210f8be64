// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

#include "cairn/mesh.hpp"

// One file format each; see write_mesh and read_mesh for what they share.
namespace cairn {

void write_gltf(const std::filesystem::path& file, const Mesh& mesh);
void write_ply(const std::filesystem::path& file, const Mesh& mesh);
[[nodiscard]] Mesh read_gltf(const std::filesystem::path& file);
[[nodiscard]] Mesh read_ply(const std::filesystem::path& file);

}  // namespace cairn
