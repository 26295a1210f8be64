// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <span>
#include <string_view>

#include "cairn/camera.hpp"

namespace cairn {

/// A camera whose intrinsics are published. A name goes wherever a camera.yaml goes (SourceOptions::camera), and is
/// scaled to images of another size and the same shape.
struct KnownCamera {
  std::string_view name;  ///< "freiburg1"
  std::string_view of;    ///< whose it is, for people
  double depth_scale;     ///< units per metre of its depth images; 0: not told
  Camera camera;
};
[[nodiscard]] std::span<const KnownCamera> known_cameras();
/// Null where there is none of this name.
[[nodiscard]] const KnownCamera* known_camera(std::string_view name);

}  // namespace cairn
