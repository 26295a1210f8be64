// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "eval/still_view.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

namespace cairn {
namespace {

constexpr std::size_t kMinSamples = 6;                       // samples
constexpr double kSigmas = 5, kMinTolerance = 0.01;          // tolerance of equal depth: multiples of the noise; meters
constexpr double kMinChange = 2;                             // multiple of the tolerance at which depth differs
constexpr int kMaxEqualLevels = 24, kMinChangedLevels = 60;  // of 255
constexpr double kMaxRestShift = 1.5;                        // pixels of the grid: limit for a pixel at rest
constexpr double kMinStillPairs = 0.7;                       // share of the pairs in which a still pixel is still
constexpr double kMinMovedPairs = 0.3;                       // share of the pairs in which a moving pixel moves
constexpr double kMinSeenPairs = 0.5,
                 kMinSeenMovingPairs = 0.25;  // share of the pairs in which a pixel has depth in both images
// Turntable: most of the static part of the view is still.
constexpr double kMinStill = 0.25, kMinMoved = 0.01, kMinStillOfRest = 0.7;

/// Counts of a pixel over all pairs.
struct PixelCounts {
  int seen = 0, still = 0, moved = 0;
};

/// Compares the pixels of two images.
class Pair {
 public:
  Pair(const Camera& grid, const SensorModel& sensor, const PlacedSample& a, const PlacedSample& b)
      : grid_(grid),
        sensor_(sensor),
        a_(*a.sample),
        b_(*b.sample),
        b_from_a_(b.world_from_camera.inverse() * a.world_from_camera) {}

  void count(std::vector<PixelCounts>& pixels) const {
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      if (a_.depth[i] == 0 || b_.depth[i] == 0) continue;
      const auto reprojected = reproject(i);
      if (!reprojected) continue;
      PixelCounts& p = pixels[i];
      ++p.seen;
      const bool is_same = difference(i)<1, is_changed = difference(i)> kMinChange;
      if (reprojected->is_rest) {
        p.still += is_same;
        p.moved += is_changed && !reprojected->fits;
      } else {
        p.still += is_same && !reprojected->fits;
        p.moved += is_changed;
      }
    }
  }

 private:
  [[nodiscard]] double noise(double z) const {
    return std::max(kMinTolerance, kSigmas * static_cast<double>(sensor_.sigma(static_cast<float>(z))));
  }
  /// Difference at the same pixel; below 1: equal, above kMinChange: different.
  [[nodiscard]] double difference(std::size_t i) const {
    const double depth = std::abs(a_.at(i) - b_.at(i)) / noise(a_.at(i));
    if (a_.brightness.empty() || b_.brightness.empty()) return depth;
    const int levels = std::abs(int{a_.brightness[i]} - int{b_.brightness[i]});
    return std::max(depth, levels < kMaxEqualLevels ? 0 : levels < kMinChangedLevels ? 1 : kMinChange + 1);
  }
  struct Reprojected {
    bool is_rest;  // tracked motion of the pixel is not significant
    bool fits;     // the other image agrees with the predicted depth
  };
  /// Reprojects a pixel with the tracked pose; nullopt outside the other image or without depth there.
  [[nodiscard]] std::optional<Reprojected> reproject(std::size_t i) const {
    const int x = static_cast<int>(i) % grid_.width, y = static_cast<int>(i) / grid_.width;
    const double z = a_.at(i);
    const Eigen::Vector3d point = b_from_a_ * (z * grid_.ray(x, y));
    if (!(point.z() > 0)) return std::nullopt;
    const Eigen::Vector2d at = grid_.project(point);
    const bool is_rest = (at - Eigen::Vector2d(x, y)).norm() < kMaxRestShift && std::abs(point.z() - z) < noise(z);
    const auto u = std::lround(at.x()), v = std::lround(at.y());
    if (u < 0 || v < 0 || u >= grid_.width || v >= grid_.height) return std::nullopt;
    double min_depth = 1e9, max_depth = 0;
    for (long row = std::max(0L, v - 1); row <= std::min<long>(grid_.height - 1, v + 1); ++row)
      for (long column = std::max(0L, u - 1); column <= std::min<long>(grid_.width - 1, u + 1); ++column)
        if (const double d = b_.at(static_cast<std::size_t>(row * grid_.width + column)); d > 0)
          min_depth = std::min(min_depth, d), max_depth = std::max(max_depth, d);
    if (max_depth == 0) return std::nullopt;
    const double limit = noise(point.z());
    return Reprojected{is_rest, min_depth - limit < point.z() && point.z() < max_depth + limit};
  }

  const Camera& grid_;
  const SensorModel& sensor_;
  const FrameSample &a_, &b_;
  Eigen::Isometry3d b_from_a_;
};

}  // namespace

bool StillView::is_turntable() const {
  return pairs > 0 && still > kMinStill && moved > kMinMoved && still > kMinStillOfRest * (1 - moved);
}

StillView compare_still(const Camera& grid, const SensorModel& sensor, const std::vector<PlacedSample>& samples) {
  std::vector<PlacedSample> fused;
  for (const PlacedSample& s : samples)
    if (!s.sample->held_out && s.sample->recording == samples.back().sample->recording) fused.push_back(s);
  StillView view;
  if (fused.size() < kMinSamples) return view;
  std::vector<PixelCounts> pixels(fused.front().sample->depth.size());
  for (const std::size_t offset : {fused.size() / 2, fused.size() / 3})
    for (std::size_t i = 0; i + offset < fused.size(); ++i, ++view.pairs)
      Pair(grid, sensor, fused[i], fused[i + offset]).count(pixels);
  double seen = 0, still = 0, moved = 0;
  for (const PixelCounts& p : pixels) {
    if (p.seen < kMinSeenMovingPairs * view.pairs) continue;
    const bool moves = p.moved >= kMinMovedPairs * p.seen;
    if (!moves && p.seen < kMinSeenPairs * view.pairs) continue;
    ++seen;
    moved += moves;
    still += !moves && p.still >= kMinStillPairs * p.seen;
  }
  if (seen > 0) view.still = still / seen, view.moved = moved / seen;
  return view;
}

}  // namespace cairn
