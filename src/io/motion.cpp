// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Text files of motion data next to images, in the format of TUM RGB-D (Sturm et al. 2012).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>
#include <stdexcept>

#include "base/lines.hpp"
#include "io/inertial_samples.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kSameTime = 1e-5;  // seconds

/// Reads lines `timestamp x y z`, sorted by time.
std::vector<AngularRate> read_samples(const fs::path& file, const char* axes, double units_per_second) {
  std::vector<AngularRate> samples;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != 4)
      throw std::runtime_error(fmt::format("{}:{}: expected `timestamp {}`", file.string(), line, axes));
    const auto number = [&](std::size_t i) { return number_of(words[i], file, line); };
    samples.push_back({number(0) / units_per_second, {number(1), number(2), number(3)}});
  });
  std::stable_sort(samples.begin(), samples.end(),
                   [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
  return samples;
}

/// Accelerations in the camera frame. A Kinect's accelerometer has y up and z forward: half a turn about z maps to the
/// camera frame.
std::vector<Acceleration> read_accelerations(const fs::path& file, double units_per_second) {
  std::vector<Acceleration> accelerations;
  for (const AngularRate& s : read_samples(file, "ax ay az", units_per_second))
    accelerations.push_back({s.timestamp, {-s.rate.x(), -s.rate.y(), s.rate.z()}});
  return accelerations;
}

std::optional<Eigen::Vector3d> mean_around(const std::vector<Acceleration>& samples, double timestamp) {
  auto it = std::lower_bound(samples.begin(), samples.end(), timestamp - kAccelerationWindow,
                             [](const Acceleration& a, double t) { return a.timestamp < t; });
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (; it != samples.end() && it->timestamp <= timestamp + kAccelerationWindow; ++it, ++count) sum += it->value;
  if (count == 0) return std::nullopt;
  return sum / count;
}

/// True if most samples have the time of an image: means around the images instead of samples.
bool are_means(const std::vector<Acceleration>& samples, const std::vector<Recording::Entry>& entries) {
  std::set<double> times;
  for (const auto& entry : entries) times.insert(entry.timestamp);
  const auto means = std::count_if(samples.begin(), samples.end(), [&](const Acceleration& sample) {
    const auto next = times.lower_bound(sample.timestamp - kSameTime);
    return next != times.end() && *next <= sample.timestamp + kSameTime;
  });
  return 2 * means > static_cast<std::ptrdiff_t>(samples.size());
}

}  // namespace

void add_motion(const fs::path& folder, Recording& recording, double units_per_second) {
  if (recording.entries.empty()) return;
  const auto [first, last] =
      std::minmax_element(recording.entries.begin(), recording.entries.end(),
                          [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
  const double begin = first->timestamp, end = last->timestamp;
  const auto is_disjoint = [&](const auto& samples, const char* name) {
    const bool disjoint = !samples.empty() && (samples.back().timestamp < begin || samples.front().timestamp > end);
    if (disjoint)
      recording.warnings.push_back(
          fmt::format("the times of {} do not overlap with those of the images: the file is not used", name));
    return disjoint;
  };
  if (const fs::path file = folder / "accelerometer.txt"; fs::exists(file)) {
    std::vector<Acceleration> samples = read_accelerations(file, units_per_second);
    if (!is_disjoint(samples, "accelerometer.txt")) {
      for (auto& entry : recording.entries) entry.acceleration = mean_around(samples, entry.timestamp);
      if (!are_means(samples, recording.entries)) recording.accelerations = std::move(samples);
    }
  }
  if (const fs::path file = folder / "gyroscope.txt"; fs::exists(file)) {
    recording.gyro = read_samples(file, "rx ry rz", units_per_second);
    if (is_disjoint(recording.gyro, "gyroscope.txt")) recording.gyro.clear();
  }
  if (const fs::path file = folder / "groundtruth.txt"; recording.truth.empty() && fs::exists(file)) {
    recording.truth = read_trajectory(file);
    for (StampedPose& pose : recording.truth) pose.timestamp /= units_per_second;
  }
}

}  // namespace cairn
