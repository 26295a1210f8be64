// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings of a camera at rest, before which a thing turns.
#pragma once
#include <vector>

#include "eval/map_agreement.hpp"

namespace cairn {

/// Shares of the view, by pixel, over pairs of samples far apart in time.
struct StillView {
  int pairs = 0;
  double still =
      0;  // the same depth and brightness in the same pixel, although the pose says otherwise or did not change
  double moved = 0;  // another depth or brightness, time and again, that a camera at rest does not explain
  /// Whether the camera rested, all through the recording, before something that moved.
  [[nodiscard]] bool is_turntable() const;
};

/// The two hypotheses for a pair are the camera's motion as tracked, and no motion at all. A pixel speaks for rest
/// where rest alone explains it; where tracking found hardly any motion, rest and tracking explain the same.
[[nodiscard]] StillView compare_still(const Camera& grid, const SensorModel& sensor,
                                      const std::vector<PlacedSample>& samples);

}  // namespace cairn
