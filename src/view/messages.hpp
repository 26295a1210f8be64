// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The live view's binary messages; assets/viewer/messages.js reads them. Little endian, all of 32-bit words but for the
// arrays at the end.
#pragma once
#include <Eigen/Core>
#include <string>

#include "cairn/frame.hpp"
#include "cairn/live_surface.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

/// 1, epoch, submap, cell x y z, origin x y z and size (float, metres), vertices, indices; then by vertex: position
/// (4 × uint16, in 1/65535 of the size from the origin), colour (4 × uint8), normal (4 × int8); then indices (uint16
/// where they suffice, else uint32).
[[nodiscard]] std::string part_message(const SurfacePart& part, int epoch);
/// 2, kind (0 colour, 1 depth); then a small JPEG. Depth is shown from near (red) to far (blue); black: none.
[[nodiscard]] std::string colour_message(const Frame& frame, const Camera& camera);
[[nodiscard]] std::string depth_message(const Frame& frame, const Camera& camera, float max_depth);
/// As many places of the camera as a path needs to be shown.
constexpr std::size_t kMaxPath = 4000;
/// 3, epoch, count; then time (seconds since the first) and place (metres, world) of the camera: 4 × float each, at
/// most so many.
[[nodiscard]] std::string path_message(const Trajectory& trajectory, int epoch);

}  // namespace cairn
