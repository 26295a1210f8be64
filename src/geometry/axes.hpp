// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Rotations between the world and the axes of a file, by quarter turns, exact in floating point.
#pragma once
#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/mapping/mesh.hpp"

namespace cairn {

/// Replaces Axes::automatic by `fallback`.
[[nodiscard]] constexpr Axes resolved(Axes axes, Axes fallback) { return axes == Axes::automatic ? fallback : axes; }

[[nodiscard]] Eigen::Vector3f from_world(const Eigen::Vector3f& v, Axes axes);
[[nodiscard]] Eigen::Vector3f to_world(const Eigen::Vector3f& v, Axes axes);
[[nodiscard]] Eigen::Matrix3d matrix_from_world(Axes axes);

/// Rotates positions and normals.
void turn_from_world(Mesh& mesh, Axes axes);
void turn_to_world(Mesh& mesh, Axes axes);

/// Text for comments in files: "axes zup: x right, y forward, z up".
[[nodiscard]] std::string described(Axes axes);
/// Parses the text of described(), anywhere in `text`; nullopt if absent.
[[nodiscard]] std::optional<Axes> axes_in(std::string_view text);

}  // namespace cairn
