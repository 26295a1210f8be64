// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// How far a view moves from one image to the next, without depth, corners or poses.
#pragma once
#include <optional>
#include <vector>

#include "cairn/frame.hpp"

namespace cairn {

/// The mean brightness of an image's columns and rows, or depth where there is no colour (as Milford & Wyeth 2008 tell
/// turns); and how sharp it is.
struct ViewProfile {
  std::vector<float> columns, rows;
  double brightness = 0;  // 0 to 255, the mean; 0 without colour
  /// Steps of brightness between neighbours over those between pixels four apart: a quarter in a blurred image, more in
  /// a sharp one. 0 without colour.
  double sharpness = 0;
};

/// Empty where the frame has no image of the rig's sizes.
[[nodiscard]] ViewProfile profile_of(const Frame& frame, const Rig& rig);

/// How far one view has moved against another, as shares of the image's width and height: right and down positive.
struct ViewStep {
  double right = 0, down = 0;
  [[nodiscard]] double length() const;
};
/// The whole image where the two show nothing in common; nothing of images that are plain.
[[nodiscard]] std::optional<ViewStep> step_between(const ViewProfile& before, const ViewProfile& now);

}  // namespace cairn
