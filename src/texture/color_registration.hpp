// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "shaders/texture.h"

namespace cairn {

/// Surface points possibly visible in several keyframes.
struct ColorObservations {
  std::size_t points = 0;
  std::vector<std::size_t> point;  // point index by observation
  /// Brightness in 0..1 by observation for a color camera, `sharp` or low frequencies only; -1: not visible.
  std::function<std::vector<float>(const shader::ColorCamera& camera, bool sharp)> brightness;
};

/// Rotation, translation and focal scale of the color camera that maximize the color consistency of the points (Zhou &
/// Koltun 2014, with a common correction instead of one per image). Returns no value if the improvement is too small or
/// there are too few observations.
[[nodiscard]] std::optional<shader::ColorCamera> register_color_camera(const ColorObservations& observations);

}  // namespace cairn
