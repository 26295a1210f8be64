// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The surface while it grows, in parts that can be shown one by one.
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "cairn/live_surface.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

/// How well a surface has been seen: 255 after as many observations as make its place as sure as it needs to be, eight
/// at 1 m, and in proportion to that certainty before, which grows with the root of their number.
[[nodiscard]] std::uint8_t coverage_of(float weight);

/// Knows which cells of the volume changed since they were last shown. A cell is due again when it has been seen half
/// as often as before once more: new places come first and well-known ones ever more rarely, so that a cell costs the
/// logarithm of the frames that see it.
class GrowingSurface {
 public:
  static constexpr int kCell = 4;  // bricks a side

  /// A frame changed these bricks.
  void change(std::span<const Brick> bricks);
  /// How well the cells that the last frame changed had been seen when they were last taken: the mean of their
  /// vertices' coverage, 0..1; cells that never were count 0, those without a surface do not count.
  /// Nothing before the first frame.
  [[nodiscard]] std::optional<double> coverage() const { return coverage_; }
  /// The cells that are due, most of all changed first, until they hold `max_bricks`. Cells that are not on the device
  /// wait. With `all` also those that changed but are not due.
  [[nodiscard]] std::vector<SurfacePart> take(Volume& volume, Polygonizer& polygonizer, int submap, int max_bricks,
                                              bool all);

 private:
  static constexpr float kNoSurface = -1;
  struct Seen {
    int frames = 0, since = 0;  // until it was last shown; since then
    float coverage = 0;         // when it was last shown; kNoSurface where nothing was there
  };
  std::unordered_map<Brick, Seen, BrickHash> cells_;
  std::optional<double> coverage_;
};

}  // namespace cairn
