// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/io/live_source.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn {
namespace {

constexpr double kReadEarly = 1.5;  // multiple of the reading time of a frame

}  // namespace

LiveSource::LiveSource(std::unique_ptr<Source> source, Pace pace)
    : WrappedSource(std::move(source)), pace_(pace), thread_([this](const std::stop_token& stop) {
        try {
          if (pace_ == Pace::as_it_comes) run(stop);
          if (pace_ == Pace::as_recorded) play(stop);
          if (pace_ == Pace::every_frame) play_every(stop);
        } catch (...) {
          const std::lock_guard lock(mutex_);
          error_ = std::current_exception();
        }
        const std::lock_guard lock(mutex_);
        ended_ = true;
        changed_.notify_all();
      }) {}

void LiveSource::put(Frame frame, Clock::time_point arrived) {
  const std::lock_guard lock(mutex_);
  dropped_ += newest_.has_value();
  newest_ = std::move(frame);
  newest_arrived_ = arrived;
  changed_.notify_all();
}

void LiveSource::pause(bool paused) {
  const std::lock_guard lock(mutex_);
  if (pace_ == Pace::as_it_comes || paused == paused_at_.has_value()) return;
  if (paused)
    paused_at_ = Clock::now();
  else
    paused_for_ += Clock::now() - *std::exchange(paused_at_, std::nullopt);
  changed_.notify_all();
}

void LiveSource::wait_until(std::unique_lock<std::mutex>& lock, const std::stop_token& stop,
                            Clock::time_point played_time) {
  while (!stop.stop_requested() && played() < played_time) {
    const bool was_paused = paused_at_.has_value();
    const auto has_changed = [&] { return paused_at_.has_value() != was_paused; };
    if (was_paused)
      changed_.wait(lock, stop, has_changed);
    else
      changed_.wait_until(lock, stop, played_time + paused_for_, has_changed);
  }
}

void LiveSource::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    auto frame = source_->next();
    if (!frame) return;
    put(std::move(*frame), Clock::now());
  }
}

void LiveSource::play(const std::stop_token& stop) {
  std::optional<std::pair<double, Clock::time_point>> first;  // timestamp, and wall-clock time of delivery
  double before = 0;                                          // timestamp of the previous frame
  Seconds reading{0};                                         // smoothed reading time of a frame
  const auto due = [&](double timestamp) {
    return first->second + std::chrono::duration_cast<Clock::duration>(Seconds(timestamp - first->first));
  };
  // So late that the next frame is due as well.
  const auto is_late = [&](double timestamp, Clock::time_point at) {
    return first && at - due(timestamp) > Seconds(timestamp - before);
  };
  while (!stop.stop_requested()) {
    Clock::time_point wanted;  // estimated time of the reader's next request
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [&] { return !newest_; })) return;
      wanted = taken_ + std::chrono::duration_cast<Clock::duration>(busy_);
      const auto begin = wanted - std::chrono::duration_cast<Clock::duration>(kReadEarly * reading);
      if (first) wait_until(lock, stop, begin);
      wanted = std::max(wanted, played());
    }
    const auto drop = [&](double timestamp) {
      before = timestamp;
      const std::lock_guard lock(mutex_);
      ++dropped_;
    };
    for (auto t = source_->next_timestamp(); t && is_late(*t, wanted); t = source_->next_timestamp()) {
      source_->skip();
      drop(*t);
    }
    const auto begin = Clock::now();
    auto frame = source_->next();
    if (!frame) return;
    reading += 0.2 * (Clock::now() - begin - reading);
    const auto read_at = [&] {
      const std::lock_guard lock(mutex_);
      return played();
    }();
    if (!first) first = {frame->timestamp, read_at};
    const double timestamp = frame->timestamp;
    if (is_late(timestamp, read_at)) {
      const Seconds interval(timestamp - before);
      if (!source_->next_timestamp() && reading < interval && source_->size().value_or(1) > 0) {
        drop(timestamp);
        continue;
      }
      // Reading is slower than the recording: play as fast as possible.
      if (reading >= interval) first->second += read_at - due(timestamp);
    }
    before = timestamp;
    {
      std::unique_lock lock(mutex_);
      wait_until(lock, stop, due(timestamp));
    }
    put(std::move(*frame), due(timestamp));
  }
}

void LiveSource::play_every(const std::stop_token& stop) {
  constexpr double kMaxTime = 1e8;  // seconds from the first stamp; larger values are invalid times
  std::optional<double> first;
  double last = 0;          // maximum of seconds since the first stamp so far
  Clock::time_point begin;  // playback time of the first frame without any delay
  while (!stop.stop_requested()) {
    auto frame = source_->next();  // in parallel with the reader's work on the previous frame
    if (!frame) return;
    if (!first && std::isfinite(frame->timestamp)) first = frame->timestamp;
    const double since = first ? frame->timestamp - *first : 0;
    if (std::abs(since) < kMaxTime) last = std::max(last, since);
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [&] { return !newest_; })) return;
    begin = std::max(begin, played() - std::chrono::duration_cast<Clock::duration>(Seconds(last)));
    const Clock::time_point due = begin + std::chrono::duration_cast<Clock::duration>(Seconds(last));
    wait_until(lock, stop, due);
    newest_ = *std::move(frame);
    newest_arrived_ = due;
    changed_.notify_all();
  }
}

std::optional<Frame> LiveSource::next() {
  while (true)
    if (auto frame = next_within(std::chrono::hours(1)); frame || ended()) return frame;
}

std::optional<Frame> LiveSource::next_within(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  if (!std::exchange(is_asked_, true)) busy_ += 0.2 * (played() - taken_ - busy_);
  changed_.wait_for(lock, patience, [&] { return newest_.has_value() || ended_; });
  if (!newest_) {
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
    return std::nullopt;
  }
  arrived_ = newest_arrived_ + paused_for_;
  taken_ = played();
  is_asked_ = false;
  changed_.notify_all();
  return std::exchange(newest_, std::nullopt);
}

bool LiveSource::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_ && !newest_;
}

int LiveSource::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_ + source_->dropped();
}

}  // namespace cairn
