// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>

namespace cairn {

/// The mesh of a file as a .glb of at most `max_bytes`, compressed with meshopt: with smaller textures; else, without
/// textures, as a coarse mesh with colors (see first_mesh). Empty if `max_bytes` is too small for any surface. Throws
/// std::runtime_error for a file that is not a mesh.
[[nodiscard]] std::string page_mesh(const std::filesystem::path& file, std::size_t max_bytes);

}  // namespace cairn
