// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/sensor_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string>

namespace cairn {

SensorModel sensor_model(std::string_view name) {
  std::string names;
  for (const auto& [known, model] : kSensorModels) {
    if (known == name) return model;
    names += (names.empty() ? "" : ", ") + std::string(known);
  }
  throw std::runtime_error(fmt::format("unknown sensor '{}'; known sensors: {}", name, names));
}

std::string_view to_string(const SensorModel& model) {
  const auto* known = std::find_if(std::begin(kSensorModels), std::end(kSensorModels),
                                   [&](const auto& entry) { return entry.model == model; });
  return known == std::end(kSensorModels) ? "custom" : known->name;
}

void check(const SensorModel& m) {
  const auto within = [](const char* name, float value, float min, float max) {
    if (!(value >= min && value <= max))  // also rejects NaN
      throw std::runtime_error(fmt::format("the sensor's {} is {}, allowed: {} to {}", name, value, min, max));
  };
  within("floor", m.floor, 1e-5f, 0.5f);
  within("growth", m.growth, 0, 1);
  within("sharpest", m.sharpest, 0, 10);
  within("common_error", m.common_error, 0, 10);
  within("min_depth", m.min_depth, 0.01f, 100);
  within("max_depth", m.max_depth, m.min_depth, 100);
}

}  // namespace cairn
