// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// From the world to the axes of a file, by quarter turns, which are exact.
#pragma once
#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/mesh.hpp"

namespace cairn {

/// `usual`: what Axes::automatic means.
[[nodiscard]] constexpr Axes resolved(Axes axes, Axes usual) { return axes == Axes::automatic ? usual : axes; }

[[nodiscard]] Eigen::Vector3f from_world(const Eigen::Vector3f& v, Axes axes);
[[nodiscard]] Eigen::Vector3f to_world(const Eigen::Vector3f& v, Axes axes);
[[nodiscard]] Eigen::Matrix3d matrix_from_world(Axes axes);

/// Positions and normals.
void turn_from_world(Mesh& mesh, Axes axes);
void turn_to_world(Mesh& mesh, Axes axes);

/// In words, for comments of files: "axes zup: x right, y forward, z up".
[[nodiscard]] std::string described(Axes axes);
/// The axes that such words tell, if they do.
[[nodiscard]] std::optional<Axes> axes_in(std::string_view text);

}  // namespace cairn
