// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <algorithm>

namespace cairn {

/// A place along an image, in shares of its width or height, between two nodes that lie in the middles of so many
/// cells: the first node, and how far on to the next. Beyond the outermost ones: at them. There are at least two.
struct BetweenNodes {
  int first;
  float share;
  BetweenNodes(float along, int nodes) {
    const float node = std::clamp(along * static_cast<float>(nodes) - 0.5f, 0.0f, static_cast<float>(nodes - 1));
    first = std::min(static_cast<int>(node), nodes - 2);
    share = node - static_cast<float>(first);
  }
};

}  // namespace cairn
