// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>
#include <vector>

#include "cairn/pose.hpp"
#include "map/keyframe.hpp"

namespace cairn {

/// The noise of tracking from one keyframe to another, added up. Sums over blocks of 8, 64, 512, ... keyframes are
/// kept, so that a long way costs little more than a short one.
class Drift {
 public:
  /// Takes the keyframes after those that it knows; these no longer change.
  void follow(const std::vector<Keyframe>& keyframes);
  /// Of the pose of `to` as seen from `from`, before it, in the camera's frame of `to`. Nothing where they are not of
  /// one piece: then nobody knows how they lie. `keyframes`: those that it followed.
  [[nodiscard]] std::optional<Matrix6d> covariance(const std::vector<Keyframe>& keyframes, std::size_t from,
                                                   std::size_t to) const;

 private:
  /// By steps and blocks of the first `levels` levels.
  [[nodiscard]] Matrix6d sum(const std::vector<Keyframe>& keyframes, std::size_t from, std::size_t to,
                             std::size_t levels) const;
  std::vector<std::size_t> first_of_piece_;    // by keyframe
  std::vector<std::vector<Matrix6d>> blocks_;  // by level
};

}  // namespace cairn
