// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gravity/align_gravity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace cairn {
namespace {

using Eigen::Vector3d;

// Min. ratio of the sum's norm to the sum of norms; less is not gravity in this frame.
constexpr double kMinSumNormRatio = 0.9;
constexpr double kMaxUprightTilt = 5 * std::numbers::pi / 180;  // max. tilt of upright given poses

/// Axis that points down if `up` points up.
Vector3d down_for(Up up, const Eigen::Matrix3d& world_from_camera) {
  switch (up) {
    case Up::x:
      return -Vector3d::UnitX();
    case Up::y:
      return -Vector3d::UnitY();
    case Up::z:
      return -Vector3d::UnitZ();
    case Up::minus_x:
      return Vector3d::UnitX();
    case Up::minus_y:
      return Vector3d::UnitY();
    case Up::minus_z:
      return Vector3d::UnitZ();
    case Up::camera:
    case Up::automatic:
      return world_from_camera.col(1);
  }
  return Vector3d::UnitY();
}

/// Angle in radians between +y after the rotation and the measured gravity.
std::optional<double> gravity_error(const Eigen::Quaterniond& rotation, const GravityEvidence& evidence) {
  const auto measured = accelerometer_gravity(evidence.accelerations);
  if (!measured) return std::nullopt;
  return std::acos(std::clamp((rotation * *measured).y(), -1.0, 1.0));
}

/// Axis of the frame nearest to up, within the tilt limit, if any.
std::optional<Up> up_axis(const Vector3d& down) {
  for (const Up up : {Up::x, Up::y, Up::z, Up::minus_x, Up::minus_y, Up::minus_z})
    if (down_for(up, Eigen::Matrix3d::Identity()).dot(down) > std::cos(kMaxUprightTilt)) return up;
  return std::nullopt;
}

}  // namespace

std::optional<Vector3d> accelerometer_gravity(const Eigen::Vector4d& accelerations) {
  const Vector3d sum = accelerations.head<3>();
  if (!(sum.norm() > 0) || sum.norm() < kMinSumNormRatio * accelerations[3]) return std::nullopt;
  return -sum.normalized();
}

std::optional<GravityEstimate> estimate_gravity(const GravityEvidence& evidence, Up up) {
  if (up != Up::automatic)
    return GravityEstimate{.down = down_for(up, evidence.world_from_first_camera),
                           .source = GravityAlignment::Source::option,
                           .description = up == Up::camera ? "up axis of the first camera image (Options::up)"
                                                           : fmt::format("{} is up (Options::up)", to_string(up))};
  if (evidence.inertial)
    return GravityEstimate{.down = evidence.inertial->down,
                           .source = GravityAlignment::Source::accelerometer,
                           .description = fmt::format("measured by gyroscope and accelerometer, +-{:.1f} degrees",
                                                      evidence.inertial->sigma * 180 / std::numbers::pi)};
  if (const auto measured = accelerometer_gravity(evidence.accelerations)) {
    const auto refined = refine_gravity(evidence.views, *measured);
    return GravityEstimate{.down = refined ? refined->down : *measured,
                           .source = GravityAlignment::Source::accelerometer,
                           .description = refined ? "measured by the accelerometer, refined by floors and walls"
                                                  : "measured by the accelerometer"};
  }
  if (const auto voted = vote_gravity(evidence.views))
    return GravityEstimate{
        .down = voted->down,
        .source = GravityAlignment::Source::structure,
        .description = fmt::format("estimated from floors and walls: {:.0f} % of the surface is horizontal, {:.0f} % "
                                   "vertical",
                                   100 * voted->horizontal, 100 * voted->vertical)};
  return std::nullopt;
}

GravityAlignment gravity_alignment_of(const GravityEstimate& found, const GravityEvidence& evidence) {
  const Vector3d& d = found.down;
  // The shortest rotation; not unique upside down: the half turn about x is used, as in glTF.
  const Eigen::Quaterniond rotation =
      d.y() < -1 + 1e-9 ? Eigen::Quaterniond(0, 1, 0, 0) : Eigen::Quaterniond::FromTwoVectors(d, Vector3d::UnitY());
  return {.source = found.source,
          .known = true,
          .world_from_tracked = rotation,
          .description = found.description,
          .off = gravity_error(rotation, evidence)};
}

GravityAlignment given_gravity_alignment(const GravityEvidence& evidence) {
  GravityAlignment upright{.source = GravityAlignment::Source::poses,
                           .description = {},
                           .off = gravity_error(Eigen::Quaterniond::Identity(), evidence)};
  const auto found = estimate_gravity(evidence, Up::automatic);
  const std::optional<Up> up = found ? up_axis(found->down) : std::nullopt;
  upright.known = up == Up::minus_y;
  if (upright.known)
    upright.description = "-y of the given poses' world is up, confirmed by floors and walls";
  else if (!found)
    upright.description = "unknown: the given poses' world is not rotated; set its up axis with Options::up";
  else
    upright.description =
        fmt::format("not along +y of the given poses' world, which is not rotated; align it with Options::up {}",
                    up ? to_string(*up) : "auto");
  return upright;
}

GravityAlignment unknown_gravity_alignment() {
  return {.description =
              "unknown: no evidence from an accelerometer, floors or walls; the map keeps the first camera's up axis; "
              "set it with Options::up",
          .off = {}};
}

}  // namespace cairn
