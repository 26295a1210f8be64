// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/sensors/sensor_source.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <cstring>
#include <stdexcept>
#include <thread>
#include <utility>

#include "io/inertial_samples.hpp"

namespace cairn {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
constexpr auto kTimeout = 2s;         // without an image, until a device counts as unplugged
constexpr auto kReportInterval = 1s;  // of an unplugged device
constexpr auto kReconnectInterval = 250ms;

class SensorSource final : public Source {
 public:
  SensorSource(std::string name, std::string layout, const std::string& serial, OpenSensor open,
               const SensorWords& words)
      : name_(std::move(name)),
        layout_(std::move(layout)),
        words_(words),
        open_(std::move(open)),
        device_(open_(serial)) {
    rig_ = device_->rig();
    serial_ = device_->serial();
    check(rig_);
  }
  const Rig& rig() const override { return rig_; }
  std::string layout() const override { return layout_; }
  std::optional<int> size() const override { return std::nullopt; }
  std::optional<std::string> ended_early() const override { return ended_early_; }
  int dropped() const override { return dropped_; }

  std::optional<Frame> next() override {
    while (!ended_early_ && !has_ended_) {
      if (!device_ && !reconnect()) return ended_early_ ? std::nullopt : std::optional(empty_frame(words_.absent));
      auto images = device_->next(kTimeout);
      if (images) {
        if (auto frame = frame_of(*std::move(images))) return frame;
        continue;
      }
      const SensorDevice::State state = device_->state();
      if (state == SensorDevice::State::silent) return empty_frame(words_.silent);
      if (state == SensorDevice::State::unplugged) disconnect();
      has_ended_ = state == SensorDevice::State::ended;
    }
    return std::nullopt;
  }

 private:
  void disconnect() {
    device_.reset();
    spdlog::warn("{}: {}", name_, words_.lost);
  }

  /// Tries for a second to open the same device.
  bool reconnect() {
    const auto end = Clock::now() + kReportInterval;
    while (!device_ && Clock::now() < end) {
      try {
        device_ = open_(serial_);
      } catch (const std::runtime_error&) {
        std::this_thread::sleep_for(kReconnectInterval);
      }
    }
    if (!device_) return false;
    if (!(device_->rig() == rig_)) {
      device_.reset();
      ended_early_ = name_ + ": the sensor was plugged in again and now has other cameras; use the same port";
      return false;
    }
    spdlog::warn("{}: {}", name_, words_.back);
    is_new_clock_ = true;
    last_number_.reset();
    return true;
  }

  [[nodiscard]] Frame empty_frame(const char* reason) {
    Frame frame{.index = index_++, .timestamp = last_timestamp_.value_or(0), .world_from_camera = {}};
    frame.problem = fmt::format("{}: {}", name_, reason);
    return frame;
  }

  /// Empty for repeated images.
  std::optional<Frame> frame_of(SensorImages images) {
    // A device starts its clock when it is plugged in: time continues by the computer's clock.
    if (is_new_clock_ && last_timestamp_)
      offset_ =
          *last_timestamp_ + std::chrono::duration<double>(Clock::now() - last_arrival_).count() - images.timestamp;
    is_new_clock_ = false;
    const double timestamp = images.timestamp + offset_;
    for (AngularRate& rate : images.rates) samples_.add_rate({rate.timestamp + offset_, rate.rate});
    for (const Acceleration& a : images.accelerations) samples_.add_acceleration({a.timestamp + offset_, a.value});
    if (last_timestamp_ && !(timestamp > *last_timestamp_)) return std::nullopt;
    if (last_number_ && images.number > *last_number_ + 1)
      dropped_ += static_cast<int>(images.number - *last_number_ - 1);
    last_number_ = images.number;
    last_timestamp_ = timestamp;
    last_arrival_ = Clock::now();
    Frame frame{.index = index_++,
                .timestamp = timestamp,
                .depth = std::move(images.depth),
                .confidence = std::move(images.confidence),
                .color_delay = images.color_delay,
                .color = std::move(images.color),
                .guess = std::move(images.guess)};
    samples_.attach_to(frame);
    return frame;
  }

  std::string name_, layout_, serial_;
  SensorWords words_;
  OpenSensor open_;
  std::unique_ptr<SensorDevice> device_;  // null: unplugged
  Rig rig_;
  InertialSamples samples_;
  std::optional<double> last_timestamp_;
  std::optional<std::int64_t> last_number_;
  Clock::time_point last_arrival_;
  double offset_ = 0;  // seconds, from the device's clock to the frames'
  bool is_new_clock_ = false, has_ended_ = false;
  int index_ = 0;
  std::atomic<int> dropped_ = 0;
  std::optional<std::string> ended_early_;
};

}  // namespace

std::unique_ptr<Source> sensor_source(const std::string& library, std::string layout, const std::string& serial,
                                      OpenSensor open, const SensorWords& words) {
  const std::string name = serial.empty() ? library : library + ":" + serial;
  try {
    return std::make_unique<SensorSource>(name, std::move(layout), serial, std::move(open), words);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(name + ": " + error.what());
  }
}

std::vector<float> depth_in_meters(const void* data, int width, int height, int stride, float meters) {
  std::vector<float> depth(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  auto* to = depth.data();
  for (int y = 0; y < height; ++y) {
    const auto* row = static_cast<const std::uint8_t*>(data) + static_cast<std::ptrdiff_t>(y) * stride;
    for (int x = 0; x < width; ++x) {
      std::uint16_t z;
      std::memcpy(&z, row + 2 * x, 2);
      *to++ = static_cast<float>(z) * meters;
    }
  }
  return depth;
}

std::vector<std::uint32_t> color_words(const void* data, int width, int height, int stride, ColorBytes bytes) {
  const std::ptrdiff_t per_pixel = bytes == ColorBytes::rgb ? 3 : 4;
  const std::size_t red = bytes == ColorBytes::rgb ? 0 : 2, blue = 2 - red;
  std::vector<std::uint32_t> color(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  auto* to = color.data();
  for (int y = 0; y < height; ++y) {
    const auto* row = static_cast<const std::uint8_t*>(data) + static_cast<std::ptrdiff_t>(y) * stride;
    for (const std::uint8_t *p = row, *end = row + per_pixel * width; p < end; p += per_pixel)
      *to++ = p[red] | std::uint32_t{p[1]} << 8 | std::uint32_t{p[blue]} << 16 | 0xff000000u;
  }
  return color;
}

}  // namespace cairn
