// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <unordered_map>
#include <vector>

#include "volume/volume.hpp"

namespace cairn {

/// Set of bricks, stored as a bit per brick in blocks of 8x8x8 bricks: one or two bytes per surface brick, compared to
/// twelve in a list.
class BrickSet {
 public:
  BrickSet() = default;
  explicit BrickSet(const std::vector<Brick>& bricks) {
    for (const Brick& brick : bricks) insert(brick);
  }
  void insert(const Brick& brick);
  [[nodiscard]] bool contains(const Brick& brick) const;
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  /// Sorted by x, then y, then z.
  [[nodiscard]] std::vector<Brick> sorted() const;

 private:
  std::unordered_map<Brick, BrickBits, BrickHash> blocks_;
  std::size_t size_ = 0;
};

}  // namespace cairn
