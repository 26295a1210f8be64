// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <vector>

#include "cairn/mesh.hpp"

namespace cairn {

/// Gives vertices the colour that the texture has there, in its place. A mesh without one stays as it is.
void take_colours(Mesh& mesh);

/// The parts of a mesh file; vertices have the colour that the texture has there, in its place.
[[nodiscard]] std::vector<Mesh> coloured_parts(const std::filesystem::path& file);

}  // namespace cairn
