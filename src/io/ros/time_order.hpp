// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Time order of queued images and samples in a reader.
#pragma once
#include <cstddef>
#include <deque>
#include <functional>
#include <iterator>
#include <utility>

namespace cairn {

/// Number of queued depth images, large enough to sort images out of order.
inline constexpr std::size_t kSortWindow = 8;

/// Inserts a value after all values that are not later. `time`: member or function that returns a value's time.
template <class T, class Time>
void insert_by_time(std::deque<T>& values, T value, const Time& time) {
  auto at = values.end();
  while (at != values.begin() && std::invoke(time, *std::prev(at)) > std::invoke(time, value)) --at;
  values.insert(at, std::move(value));
}

}  // namespace cairn
