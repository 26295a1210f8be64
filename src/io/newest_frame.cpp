// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/newest_frame.hpp"

namespace cairn {

NewestFrame::NewestFrame(std::unique_ptr<Source> source)
    : WrappedSource(std::move(source)), thread_([this](std::stop_token s) { run(s); }) {}

void NewestFrame::run(const std::stop_token& stop) {
  try {
    while (!stop.stop_requested()) {
      auto frame = source_->next();
      if (!frame) break;
      const std::lock_guard lock(mutex_);
      dropped_ += newest_.has_value();
      newest_ = std::move(frame);
      newest_arrived_ = Clock::now();
      changed_.notify_all();
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    error_ = std::current_exception();
  }
  const std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

std::optional<Frame> NewestFrame::next() {
  while (true)
    if (auto frame = next_within(std::chrono::hours(1)); frame || ended()) return frame;
}

std::optional<Frame> NewestFrame::next_within(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, patience, [&] { return newest_.has_value() || ended_; });
  if (!newest_) {
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
    return std::nullopt;
  }
  arrived_ = newest_arrived_;
  return std::exchange(newest_, std::nullopt);
}

bool NewestFrame::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_ && !newest_;
}

int NewestFrame::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_ + source_->dropped();
}

}  // namespace cairn
