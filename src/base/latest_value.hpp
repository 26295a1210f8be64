// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Latest value of a writer thread, shared with reader threads.
#pragma once
#include <memory>
#include <mutex>
#include <utility>

namespace cairn {

/// Holds the latest value written by one thread and read by any thread. Does not use std::atomic<std::shared_ptr>: in
/// GCC 12, a reader releases the pointer without release order, a data race with the next writer.
template <class T>
class LatestValue {
 public:
  void put(std::shared_ptr<const T> value) {
    const std::lock_guard lock(mutex_);
    value_.swap(value);  // destroys the old value after unlocking
  }
  [[nodiscard]] std::shared_ptr<const T> get() const {
    const std::lock_guard lock(mutex_);
    return value_;
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const T> value_;
};

}  // namespace cairn
