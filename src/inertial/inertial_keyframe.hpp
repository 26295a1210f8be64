// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>

#include "inertial/preintegration.hpp"

namespace cairn {

/// Gravity direction in a camera's frame.
struct MeasuredGravity {
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();  // unit vector
  double sigma = 0;                                 // rad
};

/// Inertial measurements of a keyframe.
struct InertialKeyframe {
  std::optional<Preintegration> step;      // motion of the sensor since the preceding keyframe; none: samples missing
  std::optional<MeasuredGravity> gravity;  // none: by no trusted filter
};

}  // namespace cairn
