// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/sign_fill.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>

namespace cairn {
namespace {

bool has(const BrickBits& bits, int x, int y, int z) {
  return (bits[static_cast<std::size_t>(x)] >> (8 * y + z) & 1) != 0;
}
void set(BrickBits& bits, int x, int y, int z) { bits[static_cast<std::size_t>(x)] |= 1ull << (8 * y + z); }

BrickBits some(std::mt19937& random, double share) {
  std::bernoulli_distribution is_set(share);
  BrickBits bits{};
  for (int i = 0; i < 512; ++i)
    if (is_set(random)) set(bits, i >> 6, i >> 3 & 7, i & 7);
  return bits;
}

TEST(FullyObservedCells, HaveEightKnownCornersAcrossBricks) {
  std::mt19937 random(1);
  std::vector<std::pair<Eigen::Vector3i, BrickBits>> known;
  for (int i = 0; i < 27; ++i)
    if (i != 5) known.emplace_back(Eigen::Vector3i(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1), some(random, 0.9));
  const auto is_known = [&](const Eigen::Vector3i& v) {
    for (const auto& [brick, bits] : known)
      if (brick == Eigen::Vector3i(v.x() >> 3, v.y() >> 3, v.z() >> 3))
        return has(bits, v.x() & 7, v.y() & 7, v.z() & 7);
    return false;
  };
  const std::vector<BrickBits> cells = fully_observed_cells(known, known.size());
  int count = 0;
  for (std::size_t i = 0; i < known.size(); ++i)
    for (int k = 0; k < 512; ++k) {
      const Eigen::Vector3i inside(k >> 6, k >> 3 & 7, k & 7);
      bool expected = true;
      for (int corner = 0; corner < 8; ++corner)
        expected = expected &&
                   is_known(8 * known[i].first + inside + Eigen::Vector3i(corner & 1, corner >> 1 & 1, corner >> 2));
      ASSERT_EQ(has(cells[i], inside.x(), inside.y(), inside.z()), expected) << inside.transpose();
      count += expected;
    }
  EXPECT_GT(count, 1000);
}

TEST(FillUnknownSigns, UsesTheSignOfTheNearestKnownVoxel) {
  std::mt19937 random(2);
  for (const double share : {0.005, 0.05, 0.5}) {
    BrickBits known = some(random, share);
    set(known, 3, 4, 5);
    BrickBits behind{};
    for (std::size_t x = 0; x < 8; ++x) behind[x] = known[x] & random();
    const BrickBits all = fill_unknown_signs(known, behind);
    for (int k = 0; k < 512; ++k) {
      const Eigen::Vector3i v(k >> 6, k >> 3 & 7, k & 7);
      int nearest = 99;
      bool is_front = false;
      for (int m = 0; m < 512; ++m) {
        const Eigen::Vector3i w(m >> 6, m >> 3 & 7, m & 7);
        if (!has(known, w.x(), w.y(), w.z())) continue;
        const int steps = (v - w).cwiseAbs().sum();
        const bool front = !has(behind, w.x(), w.y(), w.z());
        if (steps < nearest) is_front = front;
        if (steps == nearest) is_front = is_front || front;
        nearest = std::min(nearest, steps);
      }
      ASSERT_EQ(has(all, v.x(), v.y(), v.z()), !is_front) << v.transpose();
    }
  }
  EXPECT_EQ(fill_unknown_signs({}, {}), BrickBits{});
}

TEST(InsideNeighbors, NeedAMajorityOfInsideSides) {
  BrickBits half{};
  for (std::size_t x = 4; x < 8; ++x) half[x] = ~0ull;
  const std::vector<std::pair<Eigen::Vector3i, BrickBits>> bricks{{{0, 0, 0}, half}};
  const auto beside = inside_neighbors(bricks, bricks.size());
  ASSERT_EQ(beside.size(), 1u);  // above x; half of a side is not a majority
  EXPECT_EQ(beside[0], Eigen::Vector3i(1, 0, 0));
}

}  // namespace
}  // namespace cairn
