// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/upright.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace cairn {
namespace {

using Eigen::Vector3d;

constexpr double kSteady = 0.9;  // min. ratio of the sum's norm to the sum of norms; less is not gravity in this frame
constexpr double kStands = 5 * std::numbers::pi / 180;  // max. tilt of given poses that count as upright

/// Axis that points down if `up` points up.
Vector3d down_of(Up up, const Eigen::Matrix3d& world_from_camera) {
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
std::optional<double> off(const Eigen::Quaterniond& turn, const DownEvidence& evidence) {
  const auto measured = measured_down(evidence.accelerations);
  if (!measured) return std::nullopt;
  return std::acos(std::clamp((turn * *measured).y(), -1.0, 1.0));
}

/// Axis of the frame that points up, within the tilt limit, if any.
std::optional<Up> axis_up(const Vector3d& down) {
  for (const Up up : {Up::x, Up::y, Up::z, Up::minus_x, Up::minus_y, Up::minus_z})
    if (down_of(up, Eigen::Matrix3d::Identity()).dot(down) > std::cos(kStands)) return up;
  return std::nullopt;
}

}  // namespace

std::optional<Vector3d> measured_down(const Eigen::Vector4d& accelerations) {
  const Vector3d sum = accelerations.head<3>();
  if (!(sum.norm() > 0) || sum.norm() < kSteady * accelerations[3]) return std::nullopt;
  return -sum.normalized();
}

std::optional<FoundDown> find_down(const DownEvidence& evidence, Up asked) {
  if (asked != Up::automatic)
    return FoundDown{.down = down_of(asked, evidence.world_from_first_camera),
                     .source = Upright::Source::option,
                     .words = asked == Up::camera ? "as the first camera was held (Options::up)"
                                                  : fmt::format("Options::up {} points up", name_of(asked))};
  if (const auto measured = measured_down(evidence.accelerations)) {
    const auto sharper = sharpen_down(evidence.views, *measured);
    return FoundDown{.down = sharper ? sharper->down : *measured,
                     .source = Upright::Source::accelerometer,
                     .words = sharper ? "measured by the accelerometer, sharpened by floors and walls"
                                      : "measured by the accelerometer"};
  }
  if (const auto voted = vote_down(evidence.views))
    return FoundDown{.down = voted->down,
                     .source = Upright::Source::structure,
                     .words = fmt::format("found from floors and walls: {:.0f} % of the surface lies level, {:.0f} % "
                                          "stands upright",
                                          100 * voted->level, 100 * voted->upright)};
  return std::nullopt;
}

Upright upright_by(const FoundDown& found, const DownEvidence& evidence) {
  const Vector3d& d = found.down;
  // The shortest rotation; upside down it is not unique, and the half turn about x is used, as in glTF.
  const Eigen::Quaterniond turn =
      d.y() < -1 + 1e-9 ? Eigen::Quaterniond(0, 1, 0, 0) : Eigen::Quaterniond::FromTwoVectors(d, Vector3d::UnitY());
  return {.source = found.source,
          .known = true,
          .world_from_tracked = turn,
          .words = found.words,
          .off = off(turn, evidence)};
}

Upright upright_as_given(const DownEvidence& evidence) {
  Upright upright{.source = Upright::Source::poses, .words = {}, .off = off(Eigen::Quaterniond::Identity(), evidence)};
  const auto found = find_down(evidence, Up::automatic);
  const std::optional<Up> up = found ? axis_up(found->down) : std::nullopt;
  upright.known = up == Up::minus_y;
  if (upright.known)
    upright.words = "-y of the given poses' world is up, as floors and walls say, too";
  else if (!found)
    upright.words = "not known: the given poses' world stays as it is; say which of its axes is up with Options::up";
  else
    upright.words =
        fmt::format("not that of the given poses' world, which stays as it is; stand it up with Options::up {}",
                    up ? name_of(*up) : "auto");
  return upright;
}

Upright upright_unknown() {
  return {.words =
              "not known: floors and walls do not tell it here, and the map stands as the first camera was held; "
              "say it with Options::up",
          .off = {}};
}

}  // namespace cairn
