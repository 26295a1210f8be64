// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Counts from a file, before arithmetic with them.
#pragma once
#include <concepts>
#include <cstdint>
#include <limits>

namespace cairn {

/// A count of 64 bits; zero for a negative one.
[[nodiscard]] constexpr std::uint64_t count_of(std::integral auto number) {
  if constexpr (std::signed_integral<decltype(number)>) {
    if (number < 0) return 0;
  }
  return static_cast<std::uint64_t>(number);
}

/// Product of counts, at most the largest number of 64 bits: no bound holds for a product that wrapped.
[[nodiscard]] constexpr std::uint64_t product(std::integral auto first, std::integral auto... others) {
  std::uint64_t all = count_of(first);
  const auto times = [&](std::uint64_t other) {
    const bool wraps = other != 0 && all > std::numeric_limits<std::uint64_t>::max() / other;
    all = wraps ? std::numeric_limits<std::uint64_t>::max() : all * other;
  };
  (times(count_of(others)), ...);
  return all;
}

/// Whether `count` elements of `bytes_each` fit into `room` bytes behind the first `offset`.
[[nodiscard]] constexpr bool fits(std::uint64_t count, std::uint64_t bytes_each, std::uint64_t room,
                                  std::uint64_t offset = 0) {
  return offset <= room && product(count, bytes_each) <= room - offset;
}

}  // namespace cairn
