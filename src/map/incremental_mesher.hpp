// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Incremental mesh of the active submap, in cells for display.
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "cairn/mapping/surface_block.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

/// Coverage of a surface: 255 from eight observations at 1 m on, sufficient for its position accuracy; proportional to
/// the square root of their number below, as the accuracy.
[[nodiscard]] std::uint8_t coverage_of(float weight);

/// Tracks the cells of the volume that changed since their last update. A cell is due again after half as many further
/// frames as had seen it before: new surface comes first, well-observed surface ever more rarely. The number of updates
/// of a cell is logarithmic in the number of its frames.
class IncrementalMesher {
 public:
  static constexpr int kCell = 4;  // bricks per side

  /// Marks bricks changed by a frame.
  void change(std::span<const Brick> bricks);
  /// Mean coverage, 0..1, of the cells changed by the last frame, as of their last update. New cells count 0; cells
  /// without a surface are ignored. Empty before the first frame.
  [[nodiscard]] std::optional<double> coverage() const { return coverage_; }
  /// Returns the cells that are due, most changed first, up to `max_bricks`. Cells that are not on the device wait.
  /// `all`: include changed cells that are not yet due.
  [[nodiscard]] std::vector<SurfaceBlock> take(Volume& volume, Polygonizer& polygonizer, int submap, int max_bricks,
                                               bool all);

 private:
  static constexpr float kNoSurface = -1;
  struct CellState {
    int frames = 0, new_frames = 0;  // number of frames until the last update, and since
    float coverage = 0;              // at the last update; kNoSurface for an empty cell
  };
  std::unordered_map<Brick, CellState, BrickHash> cells_;
  std::optional<double> coverage_;
};

}  // namespace cairn
