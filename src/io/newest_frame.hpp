// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "io/wrapped_source.hpp"

namespace cairn {

/// Reads in a thread of its own and keeps only the newest frame: whoever is slower than the stream skips frames and
/// never lags behind. dropped() counts those that nobody took.
class NewestFrame final : public WrappedSource {
 public:
  using Clock = std::chrono::steady_clock;
  explicit NewestFrame(std::unique_ptr<Source> source);
  std::optional<Frame> next() override;
  /// The same, but at most `patience` late: nothing also when no frame came by then and the stream goes on.
  std::optional<Frame> next_within(std::chrono::milliseconds patience);
  [[nodiscard]] bool ended() const;
  [[nodiscard]] std::optional<int> size() const override { return std::nullopt; }
  [[nodiscard]] int dropped() const override;
  /// When the frame came that next() gave last.
  [[nodiscard]] Clock::time_point arrived() const { return arrived_; }

 private:
  void run(const std::stop_token& stop);

  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::optional<Frame> newest_;
  Clock::time_point newest_arrived_, arrived_;
  int dropped_ = 0;
  std::exception_ptr error_;
  bool ended_ = false;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace cairn
