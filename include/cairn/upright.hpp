// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Which way up a map stands.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cairn {

/// What points up, as somebody asks for it.
enum class Up : std::uint8_t {
  automatic,  ///< as an accelerometer, or floors and walls, tell
  camera,     ///< as the first camera was held: the top of its image is up
  x,          ///< an axis of the frame in which the camera is tracked, or of the given poses
  y,
  z,
  minus_x,
  minus_y,
  minus_z
};
/// `auto`, `camera`, `x`, `y`, `z`, `-x`, `-y` or `-z`; throws std::runtime_error for another name.
[[nodiscard]] Up up_of(std::string_view name);
[[nodiscard]] std::string_view name_of(Up up);

/// How a map is turned where it is written: rigidly, and nothing else of it changes. Tracking has a frame of its own,
/// that of the first camera (levelled, where its frame tells gravity).
struct Upright {
  enum class Source {
    accelerometer,  ///< measured; floors and walls may have sharpened it
    structure,      ///< voted for by floors and walls
    option,         ///< Options::up
    poses,          ///< the world of the given poses, which is not turned
    unknown         ///< nothing tells: the world stays the tracked frame
  };
  Source source = Source::unknown;
  bool known = false;  ///< gravity points along +y of the world that is written
  /// From the frame in which the camera is tracked, or the given poses' world, to the world that is written.
  Eigen::Quaterniond world_from_tracked = Eigen::Quaterniond::Identity();
  std::string words;          ///< a line for people: what tells, or what is missing and what to do
  std::optional<double> off;  ///< radians between +y and gravity as an accelerometer measured it

  /// Radians that the map is turned by.
  [[nodiscard]] double turned() const { return Eigen::AngleAxisd(world_from_tracked).angle(); }
};

[[nodiscard]] std::string_view name_of(Upright::Source source);

}  // namespace cairn
