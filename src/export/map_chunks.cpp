// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/map_chunks.hpp"

#include <algorithm>
#include <unordered_set>

namespace cairn {

void MapChunks::load_around(const std::vector<Brick>& chunk) const {
  if (!load) return;
  std::unordered_set<Brick, BrickHash> around;
  for (const Brick& brick : chunk)
    for (int k = 0; k < 27; ++k)
      if (const Brick b = brick + Brick(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
          std::binary_search(bricks.begin(), bricks.end(), b, before))
        around.insert(b);
  std::vector<Brick> wanted(around.begin(), around.end());
  std::sort(wanted.begin(), wanted.end(), before);
  load(wanted);
}

std::vector<std::vector<Brick>> split_bricks(std::vector<Brick> bricks) {
  constexpr std::size_t kMaxBricks = 8192;  // bricks
  constexpr int kCellSide = 16;             // bricks a side of a cube processed together
  std::sort(bricks.begin(), bricks.end(),
            [](const Brick& a, const Brick& b) { return before_by_cell(a, b, kCellSide); });
  std::vector<std::vector<Brick>> chunks;
  for (std::size_t i = 0; i < bricks.size(); i += kMaxBricks) {
    std::vector<Brick>& chunk =
        chunks.emplace_back(bricks.begin() + static_cast<std::ptrdiff_t>(i),
                            bricks.begin() + static_cast<std::ptrdiff_t>(std::min(bricks.size(), i + kMaxBricks)));
    std::sort(chunk.begin(), chunk.end(), before);
  }
  return chunks;
}

}  // namespace cairn
