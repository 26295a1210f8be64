// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "shaders/texture.h"

namespace cairn {

/// Points of a surface as several keyframes may see them.
struct ColourObservations {
  std::size_t points = 0;
  std::vector<std::size_t> point;  // of each observation
  /// Brightness of 0..1 of each observation through a colour camera, `sharp` or its low frequencies; -1: not seen.
  std::function<std::vector<float>(const shader::ColourCamera& camera, bool sharp)> brightness;
};

/// The rotation, translation and focal scale of the colour camera with which what is observed of a point agrees best
/// (as Zhou & Koltun 2014 move each image). Nothing where it does not agree much better so, or where too little is
/// observed.
[[nodiscard]] std::optional<shader::ColourCamera> register_colour_camera(const ColourObservations& observations);

}  // namespace cairn
