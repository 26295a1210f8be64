// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>
#include <vector>

#include "cairn/mapping/pose.hpp"
#include "map/keyframe.hpp"

namespace cairn {

/// Accumulated noise of tracking between keyframes. Sums over blocks of 8, 64, 512, ... keyframes are cached, so that
/// the cost grows only with the logarithm of the distance.
class Drift {
 public:
  /// Adds the keyframes after the known ones; known keyframes must not change.
  void update(const std::vector<Keyframe>& keyframes);
  /// Covariance of the pose of `to` relative to an earlier keyframe `from`, in the camera frame of `to`. Empty if the
  /// two are of different components. `keyframes`: the keyframes passed to update().
  [[nodiscard]] std::optional<Matrix6d> covariance(const std::vector<Keyframe>& keyframes, std::size_t from,
                                                   std::size_t to) const;

 private:
  /// Uses single steps and blocks of the first `levels` levels.
  [[nodiscard]] Matrix6d sum(const std::vector<Keyframe>& keyframes, std::size_t from, std::size_t to,
                             std::size_t levels) const;
  std::vector<std::size_t> first_of_component_;  // by keyframe
  std::vector<std::vector<Matrix6d>> blocks_;    // by level
};

}  // namespace cairn
