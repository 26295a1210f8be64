// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <vector>

#include "cairn/mesh.hpp"

namespace cairn {

/// Leaves the vertices that are told, in this order, with all that they carry; triangles are not touched.
void take_vertices(Mesh& mesh, const std::vector<std::uint32_t>& vertices);

/// Leaves the vertices that triangles use, in their order; returns these.
std::vector<std::uint32_t> drop_unused_vertices(Mesh& mesh);

}  // namespace cairn
