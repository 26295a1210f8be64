// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// One value that a thread replaces while others read it.
#pragma once
#include <memory>
#include <mutex>
#include <utility>

namespace cairn {

/// The newest of something that one thread makes and any thread reads. Not std::atomic<std::shared_ptr>: in GCC 12's a
/// reader gives the pointer back without release order, so that it races with whoever puts the next one.
template <class T>
class Newest {
 public:
  void put(std::shared_ptr<const T> value) {
    const std::lock_guard lock(mutex_);
    value_.swap(value);  // the old one ends after the lock
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
