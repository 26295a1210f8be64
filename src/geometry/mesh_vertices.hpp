// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "cairn/mapping/mesh.hpp"

namespace cairn {

/// Keeps the listed vertices, in this order, with all their attributes; does not change triangles.
void take_vertices(Mesh& mesh, const std::vector<std::uint32_t>& vertices);

/// Keeps the vertices used by triangles, in their order; returns their old indices.
std::vector<std::uint32_t> drop_unused_vertices(Mesh& mesh);

/// Rotates positions and normals about the origin. An identity rotation changes no bit.
void turn(Mesh& mesh, const Eigen::Quaterniond& by);
[[nodiscard]] Mesh turned(Mesh mesh, const Eigen::Quaterniond& by);

}  // namespace cairn
