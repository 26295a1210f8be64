// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Whether a camera's focal length can be right, told by two views without their poses.
#pragma once
#include <array>
#include <optional>

#include "place/features.hpp"

namespace cairn {

/// Candidates for the true focal length in units of the camera's, far beside it too.
constexpr std::array<double, 7> kFarFocalScales{0.4, 0.55, 0.75, 1.0, 1.35, 1.8, 2.5};
constexpr std::size_t kGivenFocal = 3;  // the camera's own, among them

/// Corners of `seen` that fit `known`'s by some pose, for each of kFarFocalScales. The views must be turned against
/// each other by some degrees: a wrong length bends turns. Nothing when the views share too few corners.
[[nodiscard]] std::optional<std::array<int, kFarFocalScales.size()>> focal_inliers(const Features& known,
                                                                                   const Features& seen,
                                                                                   const Camera& camera);

}  // namespace cairn
