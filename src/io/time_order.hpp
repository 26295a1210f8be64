// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Order of time of images and samples that wait in a reader.
#pragma once
#include <cstddef>
#include <deque>
#include <functional>
#include <iterator>
#include <utility>

namespace cairn {

/// Depth images that wait, so that those among them that come out of order are sorted.
inline constexpr std::size_t kSortedImages = 8;

/// Puts a value behind those that are not later. `time`: a member, or a function, that gives a value's time.
template <class T, class Time>
void put_by_time(std::deque<T>& values, T value, const Time& time) {
  auto at = values.end();
  while (at != values.begin() && std::invoke(time, *std::prev(at)) > std::invoke(time, value)) --at;
  values.insert(at, std::move(value));
}

}  // namespace cairn
