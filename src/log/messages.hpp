// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Messages of a run log, with Foxglove's schemas and Cairn's own. Times are nanoseconds; frames are names of coordinate
// frames (docs/outputs.md).
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/live_surface.hpp"
#include "cairn/mapping/reports.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "log/protobuf.hpp"

namespace cairn {

using LogTime = std::uint64_t;

struct NamedTransform {
  std::string parent, child;
  Eigen::Isometry3d parent_from_child;
};
[[nodiscard]] ProtoMessage transforms_message(LogTime time, std::span<const NamedTransform> transforms);
[[nodiscard]] ProtoMessage poses_message(LogTime time, std::string_view frame, const Trajectory& poses);

[[nodiscard]] ProtoMessage calibration_message(LogTime time, std::string_view frame, const Camera& camera);
/// Encoded as JPEG.
[[nodiscard]] ProtoMessage color_image_message(LogTime time, std::string_view frame, const Frame& of,
                                               const Camera& camera);
/// Millimeters in 16 bits; 0: no measurement, or more than 65 m.
[[nodiscard]] ProtoMessage depth_image_message(LogTime time, std::string_view frame, const Frame& of,
                                               const Camera& camera);
/// Points of every fourth pixel in every fourth row, in the depth camera's frame, with color if available.
[[nodiscard]] ProtoMessage points_message(LogTime time, std::string_view frame, const Frame& of, const Rig& rig);

/// One entity per part, replacing the previous one; empty parts are deleted. Each is fixed to its submap's frame.
[[nodiscard]] ProtoMessage surface_message(LogTime time, std::span<const SurfaceBlock> parts);
/// Deletes all entities of surface_message().
[[nodiscard]] ProtoMessage no_surface_message(LogTime time);
[[nodiscard]] std::string submap_frame(int submap);

/// Numbers of foxglove.Log.
enum class LogLevel : std::uint8_t { info = 2, warning = 3, error = 4 };
[[nodiscard]] ProtoMessage text_message(LogTime time, LogLevel level, std::string_view text);
[[nodiscard]] ProtoMessage report_message(LogTime time, const FrameReport& report);

}  // namespace cairn
