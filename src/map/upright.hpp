// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Which way up a map stands: from all that tells of it to how it is turned.
#pragma once
#include <optional>
#include <vector>

#include "cairn/upright.hpp"
#include "map/gravity.hpp"

namespace cairn {

/// What tells which way is down, in the frame in which the camera is tracked or that of the given poses.
struct DownEvidence {
  std::vector<StructureView> views;
  Eigen::Vector4d accelerations = Eigen::Vector4d::Zero();  // summed over frames, m/s^2: as a vector; their lengths
  Eigen::Matrix3d world_from_first_camera = Eigen::Matrix3d::Identity();
};

/// Down as it was found.
struct FoundDown {
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  Upright::Source source = Upright::Source::unknown;
  std::string words;
};

/// What `asked` says, or else the accelerometer, or floors and walls. Nothing where none of them tells.
[[nodiscard]] std::optional<FoundDown> find_down(const DownEvidence& evidence, Up asked);
/// The turn that brings it to +y by the shortest way.
[[nodiscard]] Upright upright_by(const FoundDown& found, const DownEvidence& evidence);
/// The given poses' world stays; it is known to stand upright where find_down() says so.
[[nodiscard]] Upright upright_as_given(const DownEvidence& evidence);
/// The tracked frame stays, since nothing tells.
[[nodiscard]] Upright upright_unknown();

/// The direction of gravity that an accelerometer measured; nothing without one, or where it contradicts the poses.
[[nodiscard]] std::optional<Eigen::Vector3d> measured_down(const Eigen::Vector4d& accelerations);

}  // namespace cairn
