// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Detection of a camera at rest in front of a rotating object.
#pragma once
#include <vector>

#include "eval/map_agreement.hpp"

namespace cairn {

/// Shares of the pixels, over pairs of samples with a large time difference.
struct StillView {
  int pairs = 0;
  double still =
      0;  // equal depth and brightness at the same pixel, although the tracked pose predicts a change or did not change
  double moved = 0;  // repeated changes of depth or brightness that a camera at rest does not explain
  /// Returns true if the camera was at rest for the complete recording, in front of a moving object.
  [[nodiscard]] bool is_turntable() const;
};

/// Tests two hypotheses per pair: the tracked camera motion, and no motion. A pixel votes for rest if only rest
/// explains it; with hardly any tracked motion, both hypotheses explain the same pixels.
[[nodiscard]] StillView compare_still(const Camera& grid, const SensorModel& sensor,
                                      const std::vector<PlacedSample>& samples);

}  // namespace cairn
