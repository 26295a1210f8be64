// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Image shift between consecutive frames, without depth, features or poses.
#pragma once
#include <optional>
#include <vector>

#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Mean brightness of an image's columns and rows, or mean depth without color (after Milford & Wyeth 2008), and its
/// sharpness.
struct ViewProfile {
  std::vector<float> columns, rows;
  double brightness = 0;  // mean, 0 to 255; 0 without color
  /// Ratio of brightness differences at one pixel distance to differences at four pixels: a quarter in a blurred image,
  /// more in a sharp image. 0 without color.
  double sharpness = 0;
};

/// Empty if the frame has no image of the rig's size.
[[nodiscard]] ViewProfile profile_of(const Frame& frame, const Rig& rig);

/// Shift of a view as shares of the image's width and height, positive to the right and down.
struct ViewStep {
  double right = 0, down = 0;
  [[nodiscard]] double length() const;
};
/// A component of 1 means no overlap; nullopt for flat images.
[[nodiscard]] std::optional<ViewStep> step_between(const ViewProfile& before, const ViewProfile& now);

}  // namespace cairn
