// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Frames of sensors whose libraries are loaded at run time, RealSense and Azure Kinect, and of clients over a network.
#pragma once
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Images of an exposure and the inertial samples before them. Times are seconds in the device's clock.
struct SensorImages {
  double timestamp = 0;
  std::int64_t number = 0;  // counts exposures, dropped ones too
  std::vector<float> depth;
  double color_delay = 0;                  // see Frame
  std::vector<std::uint32_t> color;        // empty: none
  std::vector<std::uint8_t> confidence;    // see Frame
  std::optional<Eigen::Isometry3d> guess;  // see Frame
  std::vector<AngularRate> rates;
  std::vector<Acceleration> accelerations;
};

/// A connected device with running cameras.
class SensorDevice {
 public:
  virtual ~SensorDevice() = default;
  [[nodiscard]] virtual const Rig& rig() const = 0;
  [[nodiscard]] virtual std::string serial() const = 0;
  /// Waits for images; nullopt after the timeout, and if the device is unplugged.
  [[nodiscard]] virtual std::optional<SensorImages> next(std::chrono::milliseconds timeout) = 0;
  /// State after a next() without images: unplugged, connected without images, or at the end of its stream.
  enum class State { unplugged, silent, ended };
  [[nodiscard]] virtual State state() const { return State::unplugged; }
};

/// Opens a device by its serial number; empty: the first. Throws std::runtime_error with the cause and the remedy.
using OpenSensor = std::function<std::unique_ptr<SensorDevice>(const std::string& serial)>;

/// Messages about a device that is gone; each follows the source's name and a colon.
struct SensorWords {
  const char* lost = "the sensor was unplugged, or sent no image for two seconds; plug it in again to continue";
  const char* back = "the sensor is back";
  const char* absent = "the sensor is unplugged";
  const char* silent = "no image for two seconds";
};

/// Frames of the device with this serial number; empty: the first. An unplugged device is waited for: next() then
/// returns a frame with a `problem` each second, and continues with the device's images when it is plugged in again.
/// `library` and the serial number start the messages. Throws as `open`.
[[nodiscard]] std::unique_ptr<Source> sensor_source(const std::string& library, std::string layout,
                                                    const std::string& serial, OpenSensor open,
                                                    const SensorWords& words = {});

/// Depth image in meters from 16-bit units; `stride`: bytes per row.
[[nodiscard]] std::vector<float> depth_in_meters(const void* data, int width, int height, int stride, float meters);

/// Byte order of a color image.
enum class ColorBytes : std::uint8_t { rgb, bgra };
/// Color image in the format of Frame::color; `stride`: bytes per row.
[[nodiscard]] std::vector<std::uint32_t> color_words(const void* data, int width, int height, int stride,
                                                     ColorBytes bytes);

}  // namespace cairn
