// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "cairn/source.hpp"

namespace cairn {

enum class Pace {
  as_it_comes,  ///< a sensor's own
  as_recorded,  ///< each frame has its time since the first, as when it was taken
  every_frame   ///< as recorded at most, and more slowly where the reader is slower: nothing is dropped
};

/// Keeps only the newest frame, from a thread of its own: whoever is slower than the stream skips frames and never lags
/// behind. dropped() counts those that nobody took. Of a recording, frames that come too late are not even read, where
/// the source can pass over them, and the next is read just before it will be asked for; what reads more slowly than it
/// was taken plays more slowly, and a pause stops its time. With Pace::every_frame it waits for the reader.
class LiveSource final : public WrappedSource {
 public:
  using Clock = std::chrono::steady_clock;
  LiveSource(std::unique_ptr<Source> source, Pace pace);
  std::optional<Frame> next() override;
  /// The same, but at most `patience` late: nothing also when no frame came by then and the stream goes on.
  std::optional<Frame> next_within(std::chrono::milliseconds patience);
  [[nodiscard]] bool ended() const;
  /// Stops playing a recording, and goes on where it was; a sensor goes on. Nothing that comes because of it is
  /// dropped.
  void pause(bool paused);
  [[nodiscard]] std::optional<int> size() const override {
    return pace_ == Pace::every_frame ? source_->size() : std::nullopt;
  }
  [[nodiscard]] int dropped() const override;
  /// When the frame came that next() gave last; of a recording, when it was due.
  [[nodiscard]] Clock::time_point arrived() const { return arrived_; }

 private:
  using Seconds = std::chrono::duration<double>;
  void run(const std::stop_token& stop);
  void play(const std::stop_token& stop);
  void play_every(const std::stop_token& stop);
  void put(Frame frame, Clock::time_point arrived);
  // The time that recordings play in; it stands while they are paused. Of whoever holds the mutex.
  [[nodiscard]] Clock::time_point played() const { return paused_at_.value_or(Clock::now()) - paused_for_; }
  void wait_until(std::unique_lock<std::mutex>& lock, const std::stop_token& stop, Clock::time_point played_time);

  const Pace pace_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::optional<Clock::time_point> paused_at_;
  Clock::duration paused_for_{0};  ///< before
  std::optional<Frame> newest_;
  Clock::time_point newest_arrived_, taken_;  ///< in played time
  Clock::time_point arrived_;
  Seconds busy_{0};       ///< the reader is with a frame, smoothed
  bool is_asked_ = true;  ///< since a frame was taken
  int dropped_ = 0;
  std::exception_ptr error_;
  bool ended_ = false;
  std::jthread thread_;  ///< last: it uses the others
};

}  // namespace cairn
