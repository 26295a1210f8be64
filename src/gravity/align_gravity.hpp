// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gravity alignment of a map: from evidence to the rotation of the map.
#pragma once
#include <optional>
#include <vector>

#include "cairn/mapping/gravity_alignment.hpp"
#include "gravity/gravity.hpp"
#include "inertial/inertial_keyframe.hpp"

namespace cairn {

/// Evidence for the gravity direction, in the frame of tracking or of the given poses.
struct GravityEvidence {
  std::vector<StructureView> views;
  Eigen::Vector4d accelerations = Eigen::Vector4d::Zero();  // summed over frames, m/s^2: the vectors; their norms
  Eigen::Matrix3d world_from_first_camera = Eigen::Matrix3d::Identity();
  std::optional<MeasuredGravity> inertial;  // by a gyroscope and an accelerometer
};

/// Estimated gravity direction.
struct GravityEstimate {
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  GravityAlignment::Source source = GravityAlignment::Source::unknown;
  std::string description;  // see GravityAlignment
};

/// Gravity direction by `up`, or else from the inertial sensors, from the accelerometer alone, or else from floors and
/// walls. Empty without evidence.
[[nodiscard]] std::optional<GravityEstimate> estimate_gravity(const GravityEvidence& evidence, Up up);
/// Gravity alignment by the shortest rotation of the gravity direction to +y.
[[nodiscard]] GravityAlignment gravity_alignment_of(const GravityEstimate& found, const GravityEvidence& evidence);
/// Keeps the given poses' world. It is known to be upright if estimate_gravity() confirms this.
[[nodiscard]] GravityAlignment given_gravity_alignment(const GravityEvidence& evidence);
/// Keeps the tracking frame, in the absence of evidence.
[[nodiscard]] GravityAlignment unknown_gravity_alignment();

/// Gravity direction measured by an accelerometer. Empty without one, or if it contradicts the poses.
[[nodiscard]] std::optional<Eigen::Vector3d> accelerometer_gravity(const Eigen::Vector4d& accelerations);

}  // namespace cairn
