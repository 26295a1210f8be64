// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Second pass over a recording after its keyframes were adjusted: fuses the keyframes first, and tracks the frames
// between them against this map.
#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "mapper/held_out_frames.hpp"
#include "mapper/map_state.hpp"

namespace cairn {

struct SecondPassOptions {
  AddedCalibration added;
  /// Maximum number of frames between two tracked frames, at small view changes: their poses are interpolated, and
  /// every second of them is fused.
  int max_interpolated = 0;
  bool keeps_held_out = false;  // for SecondPassResult::held_out
  /// Errors of the map so far; a new map that the held-out frames do not confirm is discarded. Null: no comparison.
  const HeldOutError* before = nullptr;
};

struct SecondPassResult {
  bool is_replaced = false;           // false: the map is as before
  std::optional<HeldOutError> error;  // of the new map, with SecondPassOptions::before
  std::vector<Frame> held_out;        // as read, with SecondPassOptions::keeps_held_out
};

/// Implements Mapper::reintegrate. `progress` receives the number of frames so far.
[[nodiscard]] SecondPassResult reintegrate(MapState& state, Source& source, const SecondPassOptions& options,
                                           const std::function<bool(int)>& progress);

/// Fuses held-out frames into a map of a single submap, at their poses.
void fuse_held_out(MapState& state, const std::vector<Frame>& frames);

}  // namespace cairn
