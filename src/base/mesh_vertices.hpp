// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "cairn/mesh.hpp"

namespace cairn {

/// Leaves the vertices that are told, in this order, with all that they carry; triangles are not touched.
void take_vertices(Mesh& mesh, const std::vector<std::uint32_t>& vertices);

/// Leaves the vertices that triangles use, in their order; returns these.
std::vector<std::uint32_t> drop_unused_vertices(Mesh& mesh);

/// Turns positions and normals about the origin. A turn by nothing changes no bit.
void turn(Mesh& mesh, const Eigen::Quaterniond& by);
[[nodiscard]] Mesh turned(Mesh mesh, const Eigen::Quaterniond& by);

}  // namespace cairn
