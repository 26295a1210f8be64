// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/inspect_inertial.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr double kGravity = 9.81;                // m/s^2
constexpr double kMaxNormError = 0.1;            // share of gravity, of the median norm
constexpr double kMaxRate = 35;                  // rad/s; above a hand's and the range of common sensors
constexpr double kMinHertz = 50, kMaxGap = 0.1;  // seconds between samples, and between the ends of both sensors
constexpr int kMinSaturated = 5;                 // samples at exactly the same extreme value
constexpr std::size_t kMinSamples = 20;

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// A sensor's times and values.
struct Samples {
  const char* name;
  std::vector<double> times;
  std::vector<Eigen::Vector3d> values;
};

Samples of(const std::vector<AngularRate>& rates) {
  Samples s{"gyroscope", {}, {}};
  for (const AngularRate& r : rates) s.times.push_back(r.timestamp), s.values.push_back(r.rate);
  return s;
}

Samples of(const std::vector<Acceleration>& accelerations) {
  Samples s{"accelerometer", {}, {}};
  for (const Acceleration& a : accelerations) s.times.push_back(a.timestamp), s.values.push_back(a.value);
  return s;
}

std::vector<double> steps_of(const Samples& s) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < s.times.size(); ++i) steps.push_back(s.times[i] - s.times[i - 1]);
  return steps;
}

InertialSummary::Sensor sensor_of(const Samples& s) {
  const std::vector<double> steps = steps_of(s);
  const double step = median(steps);
  return {.samples = static_cast<int>(s.times.size()),
          .rate = step > 0 ? 1 / step : 0,
          .longest_gap = steps.empty() ? 0 : *std::max_element(steps.begin(), steps.end())};
}

/// Axes that rest at one value, or stop at an extreme value.
void add_doubtful_axes(const Samples& s, std::vector<std::string>& doubts) {
  for (int axis = 0; axis < 3; ++axis) {
    double low = s.values[0][axis], high = low;
    for (const Eigen::Vector3d& v : s.values) low = std::min(low, v[axis]), high = std::max(high, v[axis]);
    const char name = "xyz"[axis];
    if (low == high) {
      doubts.push_back(fmt::format("the {}'s {} axis is always {:.3g}: it is not measured", s.name, name, low));
      continue;
    }
    const double extreme = std::max(std::abs(low), std::abs(high));
    const auto at_extreme = std::count_if(s.values.begin(), s.values.end(),
                                          [&](const Eigen::Vector3d& v) { return std::abs(v[axis]) == extreme; });
    if (at_extreme >= kMinSaturated)
      doubts.push_back(fmt::format("the {}'s {} axis is saturated at {:.4g} in {} of {} samples: faster motion is lost",
                                   s.name, name, extreme, at_extreme, s.values.size()));
  }
}

void add_doubts(const Samples& s, const InertialSummary::Sensor& sensor, std::vector<std::string>& doubts) {
  if (s.times.size() < kMinSamples) return;
  add_doubtful_axes(s, doubts);
  if (sensor.rate < kMinHertz)
    doubts.push_back(fmt::format("the {} has {:.0f} samples per second: motion needs at least {:.0f}", s.name,
                                 sensor.rate, kMinHertz));
  if (sensor.longest_gap > kMaxGap)
    doubts.push_back(
        fmt::format("the {} has no sample for {:.2f} s: no motion is predicted there", s.name, sensor.longest_gap));
}

}  // namespace

void InertialRecord::add(const Frame& frame) {
  rates.insert(rates.end(), frame.gyro.begin(), frame.gyro.end());
  accelerations.insert(accelerations.end(), frame.accelerations.begin(), frame.accelerations.end());
}

InertialSummary summarize(const InertialRecord& record) {
  InertialSummary summary{.gyroscope = sensor_of(of(record.rates)),
                          .accelerometer = sensor_of(of(record.accelerations))};
  std::vector<double> norms;
  norms.reserve(record.accelerations.size());
  for (const Acceleration& a : record.accelerations) norms.push_back(a.value.norm());
  summary.norm = median(std::move(norms));
  return summary;
}

std::vector<std::string> find_doubts(const InertialRecord& record, const InertialSummary& summary) {
  std::vector<std::string> doubts;
  const Samples rates = of(record.rates), accelerations = of(record.accelerations);
  add_doubts(rates, summary.gyroscope, doubts);
  add_doubts(accelerations, summary.accelerometer, doubts);
  if (accelerations.times.size() >= kMinSamples && std::abs(summary.norm - kGravity) > kMaxNormError * kGravity)
    doubts.push_back(fmt::format("the accelerometer's norm is mostly {:.3g} m/s^2 instead of 9.81: check its unit{}",
                                 summary.norm, std::abs(summary.norm - 1) < kMaxNormError ? " (g)" : ""));
  double fastest = 0;
  for (const Eigen::Vector3d& rate : rates.values) fastest = std::max(fastest, rate.norm());
  if (fastest > kMaxRate)
    doubts.push_back(fmt::format("the gyroscope reports up to {:.0f} rad/s: check its unit (degrees/s)", fastest));
  if (rates.times.size() >= kMinSamples && accelerations.times.size() >= kMinSamples) {
    const double off = std::max(std::abs(rates.times.front() - accelerations.times.front()),
                                std::abs(rates.times.back() - accelerations.times.back()));
    if (off > kMaxGap)
      doubts.push_back(
          fmt::format("the times of gyroscope and accelerometer differ by {:.2f} s at their ends: they are not "
                      "synchronized",
                      off));
  }
  return doubts;
}

}  // namespace cairn
