// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gravity alignment of a map: from evidence to the rotation of the map.
#pragma once
#include <optional>
#include <vector>

#include "cairn/upright.hpp"
#include "map/gravity.hpp"

namespace cairn {

/// Evidence for the gravity direction, in the frame of tracking or of the given poses.
struct DownEvidence {
  std::vector<StructureView> views;
  Eigen::Vector4d accelerations = Eigen::Vector4d::Zero();  // summed over frames, m/s^2: the vectors; their norms
  Eigen::Matrix3d world_from_first_camera = Eigen::Matrix3d::Identity();
};

/// Estimated gravity direction.
struct FoundDown {
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  Upright::Source source = Upright::Source::unknown;
  std::string words;
};

/// Gravity direction by `asked`, or else from the accelerometer, or else from floors and walls. Empty without evidence.
[[nodiscard]] std::optional<FoundDown> find_down(const DownEvidence& evidence, Up asked);
/// Gravity alignment by the shortest rotation of the gravity direction to +y.
[[nodiscard]] Upright upright_by(const FoundDown& found, const DownEvidence& evidence);
/// Keeps the given poses' world. It is known to be upright if find_down() confirms this.
[[nodiscard]] Upright upright_as_given(const DownEvidence& evidence);
/// Keeps the tracking frame, in the absence of evidence.
[[nodiscard]] Upright upright_unknown();

/// Gravity direction measured by an accelerometer. Empty without one, or if it contradicts the poses.
[[nodiscard]] std::optional<Eigen::Vector3d> measured_down(const Eigen::Vector4d& accelerations);

}  // namespace cairn
