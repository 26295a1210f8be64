// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The surface while it grows, in parts that can be shown one by one.
#pragma once
#include <span>
#include <unordered_map>
#include <vector>

#include "cairn/live_surface.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

/// Knows which cells of the volume changed since they were last shown. A cell is due again when it has been seen half
/// as often as before once more: new places come first and well-known ones ever more rarely, so that a cell costs the
/// logarithm of the frames that see it.
class GrowingSurface {
 public:
  static constexpr int kCell = 4;  // bricks a side

  /// A frame changed these bricks.
  void change(std::span<const Brick> bricks);
  /// The cells that are due, most of all changed first, until they hold `max_bricks`. Cells that are not on the device
  /// wait. With `all` also those that changed but are not due.
  [[nodiscard]] std::vector<SurfacePart> take(Volume& volume, Polygonizer& polygonizer, int submap, int max_bricks,
                                              bool all);

 private:
  struct Seen {
    int frames = 0, since = 0;  // until it was last shown; since then
  };
  std::unordered_map<Brick, Seen, BrickHash> cells_;
};

}  // namespace cairn
