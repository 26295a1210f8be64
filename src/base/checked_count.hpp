// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Overflow-safe arithmetic with counts from a file.
#pragma once
#include <concepts>
#include <cstdint>
#include <limits>

namespace cairn {

/// Converts a count to 64 bits; negative counts become zero.
[[nodiscard]] constexpr std::uint64_t count_of(std::integral auto number) {
  if constexpr (std::signed_integral<decltype(number)>) {
    if (number < 0) return 0;
  }
  return static_cast<std::uint64_t>(number);
}

/// Saturating product of counts: a wrapped product would pass any bound.
[[nodiscard]] constexpr std::uint64_t product(std::integral auto first, std::integral auto... others) {
  std::uint64_t all = count_of(first);
  const auto multiply = [&](std::uint64_t other) {
    const bool wraps = other != 0 && all > std::numeric_limits<std::uint64_t>::max() / other;
    all = wraps ? std::numeric_limits<std::uint64_t>::max() : all * other;
  };
  (multiply(count_of(others)), ...);
  return all;
}

/// True if `count` elements of `bytes_each` fit into `available` bytes after the first `offset`.
[[nodiscard]] constexpr bool fits(std::uint64_t count, std::uint64_t bytes_each, std::uint64_t available,
                                  std::uint64_t offset = 0) {
  return offset <= available && product(count, bytes_each) <= available - offset;
}

}  // namespace cairn
