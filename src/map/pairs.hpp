// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Keyframes that see much of the same, by where they lie, aligned with each other.
#pragma once
#include <cstddef>
#include <functional>
#include <vector>

#include "map/atlas.hpp"
#include "map/keyframe.hpp"
#include "map/match.hpp"

namespace cairn {

constexpr std::size_t kCovisible = 6;  // keyframes that one is aligned with

struct KeyframePair {
  std::size_t from = 0, to = 0;
  Eigen::Isometry3d from_to = Eigen::Isometry3d::Identity();  // guess
  int corners = 0;                                            // that agree; 0: chosen by their poses
};

/// The keyframes of the same piece behind `keyframe` that see much of the same, the nearest first. `piece`: of each
/// keyframe, see Atlas::components().
[[nodiscard]] std::vector<std::size_t> near_keyframes(const Atlas& atlas, const std::vector<std::size_t>& piece,
                                                      std::size_t keyframe);

/// Aligns the depth images of each pair, by geometry alone. Those by their looks must agree both ways round; pairs of
/// the same `from` follow each other. What does not fit is left out. `before` is
/// called before each, with its number, and may throw.
[[nodiscard]] std::vector<Loop> align_pairs(const std::vector<KeyframePair>& pairs, const KeyframeStore& images,
                                            SurfaceMatcher& matcher,
                                            const std::function<void(std::size_t)>& before = {});

}  // namespace cairn
