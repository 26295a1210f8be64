// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/brick_set.hpp"

#include <algorithm>
#include <bit>

namespace cairn {
namespace {

constexpr int kSide = 8;

struct Place {
  std::size_t word;
  std::uint64_t bit;
};
Place place_of(const Brick& brick) {
  const Brick in_block = brick - kSide * cell_of(brick, kSide);
  return {static_cast<std::size_t>(in_block.x()), std::uint64_t{1} << (kSide * in_block.y() + in_block.z())};
}

}  // namespace

void BrickSet::insert(const Brick& brick) {
  const Place place = place_of(brick);
  std::uint64_t& word = blocks_[cell_of(brick, kSide)][place.word];
  size_ += (word & place.bit) == 0;
  word |= place.bit;
}

bool BrickSet::contains(const Brick& brick) const {
  const auto block = blocks_.find(cell_of(brick, kSide));
  const Place place = place_of(brick);
  return block != blocks_.end() && (block->second[place.word] & place.bit) != 0;
}

std::vector<Brick> BrickSet::sorted() const {
  std::vector<Brick> bricks;
  bricks.reserve(size_);
  for (const auto& [block, bits] : blocks_)
    for (int x = 0; x < kSide; ++x)
      for (std::uint64_t left = bits[static_cast<std::size_t>(x)]; left != 0; left &= left - 1) {
        const int yz = std::countr_zero(left);
        bricks.push_back(kSide * block + Brick(x, yz / kSide, yz % kSide));
      }
  std::sort(bricks.begin(), bricks.end(), before);
  return bricks;
}

}  // namespace cairn
