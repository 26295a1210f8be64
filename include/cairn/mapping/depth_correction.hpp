// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

namespace cairn {

/// Systematic error of a depth camera as a function of image position: 1 / true depth = 1 / measured depth + offset. A
/// triangulating camera measures disparity, proportional to 1 / depth; a constant disparity error causes a depth error
/// that grows with the square of depth. (Schöps, Sattler & Pollefeys 2019, "BAD SLAM", equation 3, with a = 0.)
struct DepthCorrection {
  int columns = 0;             ///< grid nodes along x, at the centers of cells that divide the image evenly
  int rows = 0;                ///< grid nodes along y
  std::vector<float> offsets;  ///< 1/m, row-major; 0: not observed

  [[nodiscard]] bool empty() const { return offsets.empty(); }
  /// Offset interpolated between nodes; x and y are fractions of the image's width and height (0 to 1, edge to edge).
  /// Constant beyond the outermost nodes.
  [[nodiscard]] float at(float x, float y) const;
  /// Composition: this correction, then `next`, on the grid of this one. An empty correction is the identity.
  [[nodiscard]] DepthCorrection compose(const DepthCorrection& next) const;
  /// Corrects a row-major depth image in place, meters; 0 stays 0.
  void apply(int width, int height, std::vector<float>& depth) const;

  friend bool operator==(const DepthCorrection&, const DepthCorrection&) = default;
};

/// Throws std::runtime_error if the number of offsets does not match the grid, for an invalid grid size, and for an
/// offset above 1/m.
void check(const DepthCorrection& correction);

}  // namespace cairn
