// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/union_find.hpp"

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(UnionFind, RepresentativeIsLowestMember) {
  UnionFind<std::size_t> sets(7);
  EXPECT_EQ(sets.join(6, 5), 5u);
  EXPECT_EQ(sets.join(2, 4), 2u);
  EXPECT_EQ(sets.join(4, 6), 2u);
  EXPECT_EQ(sets.join(5, 2), 2u);  // already joined
  EXPECT_EQ(sets.all(), (std::vector<std::size_t>{0, 1, 2, 3, 2, 2, 2}));
}

TEST(UnionFind, MatchesPlainRelabeling) {
  constexpr std::uint32_t kCount = 200;
  UnionFind<std::uint32_t> sets(kCount);
  std::vector<std::uint32_t> slow(kCount);
  std::iota(slow.begin(), slow.end(), 0u);
  for (std::uint32_t i = 0; i < 150; ++i) {
    const std::uint32_t a = i * 7919 % kCount, b = (i * i + 31) % kCount, low = slow[a], high = slow[b];
    std::replace(slow.begin(), slow.end(), std::max(low, high), std::min(low, high));
    EXPECT_EQ(sets.join(a, b), slow[a]);
    ASSERT_EQ(sets.all(), slow);
  }
}

}  // namespace
}  // namespace cairn
