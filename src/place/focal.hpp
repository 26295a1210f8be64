// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Plausibility of a camera's focal length, from two views without poses.
#pragma once
#include <array>
#include <optional>

#include "place/features.hpp"

namespace cairn {

/// Candidates for the true focal length in units of the camera's, over a wide range.
constexpr std::array<double, 7> kWideFocalScales{0.4, 0.55, 0.75, 1.0, 1.35, 1.8, 2.5};
constexpr std::size_t kGivenFocal = 3;  // index of the camera's own focal length

/// Number of features of `seen` that fit features of `known` with some pose, for each of kWideFocalScales. The views
/// must differ by a rotation of some degrees, since a wrong focal length distorts rotations. Empty with too few
/// matches.
[[nodiscard]] std::optional<std::array<int, kWideFocalScales.size()>> focal_inliers(const Features& known,
                                                                                    const Features& seen,
                                                                                    const Camera& camera);

}  // namespace cairn
