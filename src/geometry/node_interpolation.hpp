// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <algorithm>

namespace cairn {

/// Linear interpolation along one image axis, between nodes at the centers of equal cells: index of the first node, and
/// the fraction toward the next. `along` is a fraction of the image's width or height. Clamped to the outermost nodes.
/// Requires at least two nodes.
struct NodeInterpolation {
  int first;
  float share;
  NodeInterpolation(float along, int nodes) {
    const float node = std::clamp(along * static_cast<float>(nodes) - 0.5f, 0.0f, static_cast<float>(nodes - 1));
    first = std::min(static_cast<int>(node), nodes - 2);
    share = node - static_cast<float>(first);
  }
};

}  // namespace cairn
