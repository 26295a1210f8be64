// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "cairn/io/source.hpp"

namespace cairn {

enum class Pace {
  as_it_comes,  ///< pace of a sensor
  as_recorded,  ///< frames keep their original time since the first frame
  every_frame   ///< recorded pace at most, slower for a slow reader: never drops a frame
};

/// Reads a source in a separate thread and keeps only the newest frame, so a slow reader skips frames but never lags
/// behind. dropped() counts the skipped frames. For recordings, late frames are skipped unread if the source supports
/// it, and the next frame is read just before it is due; a recording that cannot be read in real time plays more
/// slowly, and a pause stops its clock. With Pace::every_frame it waits for the reader.
class LiveSource final : public WrappedSource {
 public:
  using Clock = std::chrono::steady_clock;
  LiveSource(std::unique_ptr<Source> source, Pace pace);
  std::optional<Frame> next() override;
  /// As next(), with a timeout of `patience`: also returns nullopt if no frame arrived in time and the stream
  /// continues.
  std::optional<Frame> next_within(std::chrono::milliseconds patience);
  [[nodiscard]] bool ended() const;
  /// Pauses and continues a recording at the same position; a sensor keeps running. Frames missed during a pause do not
  /// count as dropped.
  void pause(bool paused);
  [[nodiscard]] std::optional<int> size() const override {
    return pace_ == Pace::every_frame ? source_->size() : std::nullopt;
  }
  [[nodiscard]] int dropped() const override;
  /// Arrival time of the last frame from next(); for a recording, its due time.
  [[nodiscard]] Clock::time_point arrived() const { return arrived_; }

 private:
  using Seconds = std::chrono::duration<double>;
  void run(const std::stop_token& stop);
  void play(const std::stop_token& stop);
  void play_every(const std::stop_token& stop);
  void put(Frame frame, Clock::time_point arrived);
  // Playback clock of recordings; stopped during a pause. Requires the mutex.
  [[nodiscard]] Clock::time_point played() const { return paused_at_.value_or(Clock::now()) - paused_for_; }
  void wait_until(std::unique_lock<std::mutex>& lock, const std::stop_token& stop, Clock::time_point played_time);

  const Pace pace_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::optional<Clock::time_point> paused_at_;
  Clock::duration paused_for_{0};  ///< earlier pauses
  std::optional<Frame> newest_;
  Clock::time_point newest_arrived_, taken_;  ///< in playback time
  Clock::time_point arrived_;
  Seconds busy_{0};       ///< processing time of the reader per frame, smoothed
  bool is_asked_ = true;  ///< true: next() was called since the last frame was taken
  int dropped_ = 0;
  std::exception_ptr error_;
  bool ended_ = false;
  std::jthread thread_;  ///< last member: the thread uses the others
};

}  // namespace cairn
