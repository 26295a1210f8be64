// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/checked_count.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace cairn {
namespace {

constexpr std::uint64_t kMax = std::numeric_limits<std::uint64_t>::max();

TEST(CheckedCount, ProductSaturates) {
  EXPECT_EQ(product(3, 640u, std::uint64_t{480}), 921'600u);
  EXPECT_EQ(product(1 << 30, 1 << 30, 1 << 30), kMax);
  EXPECT_EQ(product(kMax, 2), kMax);
  EXPECT_EQ(product(kMax, 0, kMax), 0u);
  EXPECT_EQ(product(kMax, kMax, 0), 0u);
}

TEST(CheckedCount, NegativeCountIsZero) {
  EXPECT_EQ(product(-1, 5), 0u);
  EXPECT_EQ(count_of(std::numeric_limits<int>::min()), 0u);
}

TEST(CheckedCount, FitsIsFalseOnOverflow) {
  EXPECT_TRUE(fits(4, 8, 40, 8));
  EXPECT_FALSE(fits(4, 8, 39, 8));
  EXPECT_FALSE(fits(std::uint64_t{1} << 61, 8, 1000));  // 2^64, which overflows to 0
  EXPECT_FALSE(fits(0, 8, 4, 5));
}

}  // namespace
}  // namespace cairn
