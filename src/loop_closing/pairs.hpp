// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Covisible keyframe pairs, selected by pose and aligned with each other.
#pragma once
#include <cstddef>
#include <functional>
#include <vector>

#include "loop_closing/match.hpp"
#include "map/atlas.hpp"
#include "map/keyframe.hpp"

namespace cairn {

constexpr std::size_t kMaxCovisible = 6;  // keyframes to align per keyframe

struct KeyframePair {
  std::size_t from = 0, to = 0;
  Eigen::Isometry3d from_to = Eigen::Isometry3d::Identity();  // initial guess
  int feature_inliers = 0;                                    // feature inliers; 0: chosen by pose
};

/// Covisible keyframes after `keyframe` in the same component, nearest first. `component`: component by keyframe, see
/// Atlas::components().
[[nodiscard]] std::vector<std::size_t> covisible_keyframes(const Atlas& atlas,
                                                           const std::vector<std::size_t>& component,
                                                           std::size_t keyframe);

/// Aligns the depth images of each pair, by geometry alone. Pairs found by features must agree in both directions.
/// Pairs with the same `from` must be adjacent. Failed alignments are left out. `before` is called before each pair,
/// with its index, and may throw.
[[nodiscard]] std::vector<Loop> align_pairs(const std::vector<KeyframePair>& pairs, const KeyframeStore& images,
                                            SurfaceMatcher& matcher,
                                            const std::function<void(std::size_t)>& before = {});

}  // namespace cairn
