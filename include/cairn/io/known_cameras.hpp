// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <span>
#include <string_view>

#include "cairn/mapping/camera.hpp"

namespace cairn {

/// Camera with published intrinsics. Its name is accepted in place of a camera.yaml (SourceOptions::camera). Intrinsics
/// are scaled to images of another size with the same aspect ratio.
struct KnownCamera {
  std::string_view name;  ///< "freiburg1"
  std::string_view of;    ///< device or data set, for messages
  double depth_scale;     ///< units per meter of its depth images; 0: unknown
  Camera camera;
};
[[nodiscard]] std::span<const KnownCamera> known_cameras();
/// Returns null for an unknown name.
[[nodiscard]] const KnownCamera* known_camera(std::string_view name);

}  // namespace cairn
