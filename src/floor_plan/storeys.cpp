// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/storeys.hpp"

#include <algorithm>
#include <cmath>

namespace cairn::plan {
namespace {

constexpr double kBin = 0.01;             // meters
constexpr int kLevelBins = 5;             // bins to each side of a level
constexpr double kMinLevelCosine = 0.94;  // cosine of 20 degrees, between a level surface's normal and up
constexpr double kMinFloorArea = 0.25;    // m2 of a floor
constexpr double kMinFloorRatio = 0.1;    // of the largest level's surface
constexpr double kMinStoreyHeight = 2.0;  // meters between floors, at least
constexpr double kMaxStepHeight = 0.35;   // meters: a slightly lower and much smaller level within this distance is a
                                          // step or a pit
constexpr double kMinAreaRatio = 2.0;     // ratio
constexpr double kMinCameraHeight = 0.2, kMaxCameraHeight = 2.5;  // meters above a floor: range of camera heights
constexpr double kMinPosesRatio = 0.02;                           // share of the poses above a floor, at least

/// True if a camera was carried over a level.
bool was_walked(double level, const std::vector<double>& cameras) {
  if (cameras.empty()) return true;
  const auto above = std::count_if(cameras.begin(), cameras.end(), [&](double h) {
    return h > level + kMinCameraHeight && h < level + kMaxCameraHeight;
  });
  return static_cast<double>(above) >= kMinPosesRatio * static_cast<double>(cameras.size());
}

}  // namespace

void LevelSurface::add(const Mesh& mesh) {
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.positions[t[0]].cast<double>(), b = mesh.positions[t[1]].cast<double>(),
                          c = mesh.positions[t[2]].cast<double>();
    const Eigen::Vector3d twice = (b - a).cross(c - a);
    const double norm = twice.norm();
    if (std::abs(twice.y()) < kMinLevelCosine * norm || norm <= 0) continue;
    const double height = height_of((a + b + c) / 3);
    Level& level = (twice.y() < 0 ? upward_ : downward_)[static_cast<int>(std::floor(height / kBin))];
    level.height = (level.area * level.height + 0.5 * norm * height) / (level.area + 0.5 * norm);
    level.area += 0.5 * norm;
  }
}

double LevelSurface::area_around(const Levels& levels, int bin) {
  double sum = 0;
  for (auto it = levels.lower_bound(bin - kLevelBins); it != levels.end() && it->first <= bin + kLevelBins; ++it)
    sum += it->second.area;
  return sum;
}

/// Area weighted by proximity: largest at the middle of a level.
double LevelSurface::weighted_area_around(const Levels& levels, int bin) {
  double sum = 0;
  for (auto it = levels.lower_bound(bin - kLevelBins); it != levels.end() && it->first <= bin + kLevelBins; ++it)
    sum += it->second.area * (1 - std::abs(it->first - bin) / (kLevelBins + 1.0));
  return sum;
}

/// Mean height.
double LevelSurface::height_around(const Levels& levels, int bin) {
  double sum = 0;
  for (auto it = levels.lower_bound(bin - kLevelBins); it != levels.end() && it->first <= bin + kLevelBins; ++it)
    sum += it->second.area * it->second.height;
  return sum / area_around(levels, bin);
}

std::vector<double> LevelSurface::floors(const std::vector<Trajectory>& paths) const {
  std::vector<double> cameras;
  for (const Trajectory& path : paths)
    for (const StampedPose& pose : path) cameras.push_back(height_of(pose.world_from_camera.translation()));
  std::vector<int> peaks;
  double largest = 0;
  for (const auto& [bin, area] : upward_) {
    const double current = weighted_area_around(upward_, bin);
    largest = std::max(largest, area_around(upward_, bin));
    bool is_peak = true;
    for (int other = bin - kLevelBins; other <= bin + kLevelBins && is_peak; ++other)
      is_peak = other == bin || (other < bin ? weighted_area_around(upward_, other) < current
                                             : weighted_area_around(upward_, other) <= current);
    if (is_peak) peaks.push_back(bin);
  }
  std::erase_if(peaks, [&](int bin) {
    return area_around(upward_, bin) < std::max(kMinFloorArea, kMinFloorRatio * largest) ||
           !was_walked(kBin * bin, cameras);
  });
  std::vector<double> floors;
  for (std::size_t i = 0; i < peaks.size(); ++i) {
    if (!floors.empty() && kBin * peaks[i] < floors.back() + kMinStoreyHeight) continue;
    int chosen = peaks[i];
    for (std::size_t k = i + 1; k < peaks.size() && kBin * (peaks[k] - peaks[i]) < kMaxStepHeight; ++k)
      if (area_around(upward_, peaks[k]) > kMinAreaRatio * area_around(upward_, chosen)) chosen = peaks[k];
    floors.push_back(height_around(upward_, chosen));
  }
  return floors;
}

std::optional<double> LevelSurface::height_above(double floor, double max) const {
  std::optional<int> best;
  for (const auto& [bin, level] : downward_) {
    const double height = kBin * (bin + 0.5) - floor;
    if (height < kMinStoreyHeight || height > max) continue;
    if (!best || weighted_area_around(downward_, bin) > weighted_area_around(downward_, *best)) best = bin;
  }
  if (!best || area_around(downward_, *best) < kMinFloorArea) return std::nullopt;
  return height_around(downward_, *best) - floor;
}

}  // namespace cairn::plan
