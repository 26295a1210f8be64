// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Binary messages of the live view, read by assets/viewer/messages.js. Little endian, 32-bit words except the arrays at
// the end.
#pragma once
#include <Eigen/Core>
#include <string>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/live_surface.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// 1, epoch, submap, cell x y z, origin x y z and size (float, meters), vertices, indices; then by vertex: position (4
/// × uint16, in 1/65535 of the size from the origin), color (4 × uint8), normal (4 × int8); then indices (uint16 if
/// sufficient, else uint32).
[[nodiscard]] std::string part_message(const SurfaceBlock& part, int epoch);
/// 2, kind (0 color, 1 depth); then a small JPEG. Depth is shown from near (red) to far (blue); black: none.
[[nodiscard]] std::string color_message(const Frame& frame, const Camera& camera);
[[nodiscard]] std::string depth_message(const Frame& frame, const Camera& camera, float max_depth);
/// Maximum number of camera positions in a path message.
constexpr std::size_t kMaxPath = 4000;
/// 3, epoch, count; then time (seconds since the first) and position (meters, world) of the camera: 4 × float each, at
/// most kMaxPath.
[[nodiscard]] std::string path_message(const Trajectory& trajectory, int epoch);

}  // namespace cairn
