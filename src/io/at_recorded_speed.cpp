// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <chrono>
#include <thread>
#include <utility>

#include "cairn/source.hpp"
#include "io/wrapped_source.hpp"

namespace cairn {
namespace {

class AtRecordedSpeed final : public WrappedSource {
 public:
  using WrappedSource::WrappedSource;

  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (!frame) return frame;
    if (!first_) first_ = {frame->timestamp, Clock::now()};
    std::this_thread::sleep_until(
        first_->second +
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(frame->timestamp - first_->first)));
    return frame;
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::optional<std::pair<double, Clock::time_point>> first_;  // timestamp, and when it was given
};

}  // namespace

std::unique_ptr<Source> at_recorded_speed(std::unique_ptr<Source> source) {
  return std::make_unique<AtRecordedSpeed>(std::move(source));
}

}  // namespace cairn
