// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

namespace cairn {

/// What a depth camera errs by, by place in its image: 1 / true depth = 1 / measured depth + offset. A camera that
/// triangulates measures a disparity, which is 1 / depth up to scale; where it is off by the same at all ranges, depth
/// is off by its square. (Schöps, Sattler & Pollefeys 2019, "BAD SLAM", equation 3, with a = 0.)
struct DepthCorrection {
  int columns = 0;             ///< nodes in the middles of so many cells that divide the image evenly
  int rows = 0;                ///< the same, down
  std::vector<float> offsets;  ///< 1/m, row by row; 0: what nobody has seen

  [[nodiscard]] bool empty() const { return offsets.empty(); }
  /// Between nodes, at a place in shares of the image's width and height (0 to 1 from its edge to its edge); beyond the
  /// outermost nodes as there.
  [[nodiscard]] float at(float x, float y) const;
  /// This one and then another one, on its own grid; empty ones change nothing.
  [[nodiscard]] DepthCorrection then(const DepthCorrection& next) const;
  /// Corrects an image in place, metres, row by row; 0 stays 0.
  void apply(int width, int height, std::vector<float>& depth) const;

  friend bool operator==(const DepthCorrection&, const DepthCorrection&) = default;
};

/// Throws std::runtime_error for a grid of another size than it tells, and for an offset of more than 1/m.
void check(const DepthCorrection& correction);

}  // namespace cairn
