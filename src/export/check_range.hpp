// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <fmt/format.h>

#include <stdexcept>
#include <type_traits>

#include "options/option_ranges.hpp"

namespace cairn {

/// Throws std::runtime_error with the option, its value and its range, see export_range_of.
template <class T>
void check_range(const char* option, T value) {
  const AllowedRange allowed = export_range_of(option);
  const auto compared = [&] {
    if constexpr (std::is_same_v<T, float>)
      return value;
    else
      return static_cast<double>(value);
  }();
  if (!allowed.has(compared))
    throw std::runtime_error(
        fmt::format("{} is {}: it must be between {} and {}", option, value, allowed.min, allowed.max));
}

}  // namespace cairn
