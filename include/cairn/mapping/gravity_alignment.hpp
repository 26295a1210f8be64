// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gravity alignment of a map.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cairn {

/// Up direction, as requested by the user.
enum class Up : std::uint8_t {
  automatic,  ///< from the accelerometer, or from floors and walls
  camera,     ///< top of the first camera image
  x,          ///< axis of the tracking frame, or of the given poses
  y,
  z,
  minus_x,
  minus_y,
  minus_z
};
/// Parses `auto`, `camera`, `x`, `y`, `z`, `-x`, `-y` or `-z`; throws std::runtime_error for another name.
[[nodiscard]] Up parse_up(std::string_view name);
[[nodiscard]] std::string_view to_string(Up up);

/// Gravity alignment: rigid rotation of all exported data. Tracking has its own frame, defined by the first camera
/// (leveled if its frame has an acceleration).
struct GravityAlignment {
  enum class Source {
    accelerometer,  ///< measured; refined by floors and walls where possible
    structure,      ///< voted by floors and walls
    option,         ///< Options::up
    poses,          ///< world of the given poses, not rotated
    unknown         ///< no evidence: the world is the tracking frame
  };
  Source source = Source::unknown;
  bool known = false;  ///< true: gravity is along +y of the exported world
  /// Rotation from the tracking frame, or the world of the given poses, to the exported world.
  Eigen::Quaterniond world_from_tracked = Eigen::Quaterniond::Identity();
  std::string description;    ///< one line for users: the evidence, or the missing data and the remedy
  std::optional<double> off;  ///< radians between +y and the gravity measured by the accelerometer

  /// Rotation angle, radians.
  [[nodiscard]] double rotation_angle() const { return Eigen::AngleAxisd(world_from_tracked).angle(); }
};

[[nodiscard]] std::string_view to_string(GravityAlignment::Source source);

}  // namespace cairn
