// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <string_view>

namespace cairn {

/// Noise model of a depth camera. Determines the limits of filters, edge detection, alignment, fusion and textures. The
/// default is structured light, used if the sensor is unknown.
struct SensorModel {
  /// Weight of a measurement in fusion.
  enum class Weight : std::uint8_t {
    by_distance,  ///< 1 / z^2, at most 1 (Khoshelham & Elberink 2012)
    by_noise      ///< sigma(1 m) / sigma(z), at most 1
  };
  /// Standard deviation of depth, meters: floor + growth (z - sharpest)^2. Defaults: Nguyen, Izadi & Lovell 2012, for
  /// the first Kinect.
  float floor = 0.0012f, growth = 0.0019f, sharpest = 0.4f;
  /// Standard deviation, in units of sigma, of the error that all pixels of a surface have in common.
  float common_error = 0.1f;
  float min_depth = 0.3f, max_depth = 5.0f;  ///< meters; measurements outside are dropped
  Weight weight = Weight::by_distance;
  std::uint8_t min_confidence = 1;  ///< measurements with a smaller Frame::confidence are dropped

  friend bool operator==(const SensorModel&, const SensorModel&) = default;
  [[nodiscard]] constexpr float sigma(float z) const { return floor + growth * (z - sharpest) * (z - sharpest); }
};

/// Predefined model.
struct NamedSensorModel {
  std::string_view name;
  SensorModel model;
};

inline constexpr NamedSensorModel kSensorModels[] = {
    {"structured_light", {}},  // Kinect v1, Xtion, Astra
    // Azure Kinect, Kinect v2, L515: Toelgyessy et al. 2021, with a margin for amplitude and edge effects.
    {"time_of_flight",
     {.floor = 0.0015f,
      .growth = 0.0006f,
      .sharpest = 0.5f,
      .max_depth = 5.5f,
      .weight = SensorModel::Weight::by_noise}},
    // RealSense D4xx: 0.08 pixels of disparity at a focal length of 425 pixels and a baseline of 5 cm.
    {"stereo",
     {.floor = 0.0005f, .growth = 0.0038f, .sharpest = 0, .max_depth = 6, .weight = SensorModel::Weight::by_noise}},
    // iPhone, iPad: 256x192 pixels, upsampled with color; flattens surfaces beyond 2.5 m.
    {"phone_lidar",
     {.floor = 0.004f,
      .growth = 0.0025f,
      .sharpest = 0,
      .common_error = 2,
      .weight = SensorModel::Weight::by_noise,
      .min_confidence = 128}},
    // Rendered without noise.
    {"exact", {.floor = 0.0005f, .growth = 0.0001f, .sharpest = 0, .min_depth = 0.05f, .max_depth = 10}},
};

/// Returns a predefined model; throws std::runtime_error with the valid names for an unknown name.
[[nodiscard]] SensorModel sensor_model(std::string_view name);
/// Name of a predefined model, or "custom".
[[nodiscard]] std::string_view to_string(const SensorModel& model);
/// Throws std::runtime_error naming the field, its value and the allowed range.
void check(const SensorModel& model);

}  // namespace cairn
