// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Time line of the devices of a virtual library. Words of its environment variable:
//   frames=FOLDER  images to repeat (played_images.hpp)  rate=HZ    images a second [30]
//   unplug=N       is unplugged after N images           replug=S   is plugged in again after S seconds [never]
//   drop=N         drops every N-th image                none       no device is plugged in
//   two            two devices                           busy       cannot be started
//   noimu          has no inertial sensors
#pragma once
#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "support/sensor/played_images.hpp"

namespace virtual_sensor {

constexpr double kPeriod = 1.0 / 32;  // seconds between timestamps: exact in decimal and binary
constexpr double kClockBegin = 1000;  // seconds of a device's clock at its start

/// An exposure. `number` counts dropped images too.
struct Exposure {
  int image;
  int number;
  double seconds;
};

/// All devices of a library play the same images.
class PlayedDevices {
 public:
  explicit PlayedDevices(const char* variable) : variable_(variable) {}

  [[nodiscard]] bool has(const std::string& word) const { return !setting(variable_, word).empty(); }
  [[nodiscard]] std::string word(const std::string& name) const { return setting(variable_, name); }
  [[nodiscard]] int connected() {
    const std::lock_guard lock(mutex_);
    begin_test();
    return has("none") || is_unplugged() ? 0 : has("two") ? 2 : 1;
  }
  void start() {
    const std::lock_guard lock(mutex_);
    begin_test();
    number_ = 0;
    begin_ = Clock::now();
  }
  /// Waits for the next image; empty if the device is unplugged. Reads no environment variable, which another thread
  /// may change.
  std::optional<Exposure> next() {
    while (true) {
      Exposure exposure{};
      Clock::time_point due;
      {
        const std::lock_guard lock(mutex_);
        if (unplug_ > 0 && shown_ == unplug_ && !unplugged_at_) unplugged_at_ = Clock::now();
        if (is_unplugged()) return std::nullopt;
        ++number_;
        exposure = {shown_++, number_, kClockBegin + kPeriod * number_};
        due = begin_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(number_ / rate_));
      }
      std::this_thread::sleep_until(due);
      if (drop_ == 0 || exposure.number % drop_ != 0) return exposure;
    }
  }

 private:
  using Clock = std::chrono::steady_clock;
  /// A test in the same process changes the variable.
  void begin_test() {
    const char* now = std::getenv(variable_);
    if (std::string now_set = now != nullptr ? now : ""; !setting_ || now_set != *setting_) {
      setting_ = std::move(now_set);
      rate_ = number(variable_, "rate", 30);
      replug_ = number(variable_, "replug", 1e9);
      drop_ = static_cast<int>(number(variable_, "drop", 0));
      unplug_ = static_cast<int>(number(variable_, "unplug", 0));
      shown_ = 0;
      unplugged_at_.reset();
    }
  }
  [[nodiscard]] bool is_unplugged() const {
    return unplugged_at_ && std::chrono::duration<double>(Clock::now() - *unplugged_at_).count() < replug_;
  }

  const char* variable_;
  std::mutex mutex_;
  std::optional<std::string> setting_;  // of the variable
  double rate_ = 30, replug_ = 0;
  int drop_ = 0, unplug_ = 0;
  int shown_ = 0, number_ = 0;  // images since the begin, and since the start
  Clock::time_point begin_;
  std::optional<Clock::time_point> unplugged_at_;  // stays set after the device is plugged in again
};

}  // namespace virtual_sensor
