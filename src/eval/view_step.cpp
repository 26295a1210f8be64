// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "eval/view_step.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace cairn {
namespace {

constexpr int kMaxSamples = 160;           // samples per row
constexpr double kMaxShift = 0.6;          // of the image
constexpr double kMaxDissimilarity = 0.6;  // limit for views of the same place, share of the variation
constexpr double kMinVariation = 0.04;     // of a profile's mean; a lower variation is not informative
constexpr double kMaxCostRatio = 0.75;     // maximum cost of a shift relative to no shift
constexpr int kFine = 1, kCoarse = 4;      // pixel distances for brightness differences

std::size_t pixels_of(const Camera& c) {
  return static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height);
}

float brightness_of(std::uint32_t rgba) {
  return static_cast<float>((rgba & 255) + 2 * (rgba >> 8 & 255) + (rgba >> 16 & 255)) / 4;
}

/// Averages `at(x, y)` over columns and rows.
template <class At>
void average(const Camera& camera, const At& at, ViewProfile& profile) {
  const int step = std::max(1, camera.width / kMaxSamples), columns = camera.width / step, rows = camera.height / step;
  profile.columns.assign(static_cast<std::size_t>(columns), 0.0f);
  profile.rows.assign(static_cast<std::size_t>(rows), 0.0f);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      const float value = at(x * step, y * step);
      profile.columns[static_cast<std::size_t>(x)] += value / static_cast<float>(rows);
      profile.rows[static_cast<std::size_t>(y)] += value / static_cast<float>(columns);
    }
}

double sharpness_of(const std::vector<std::uint32_t>& color, const Camera& camera) {
  constexpr int kRowStride = 8;
  double fine = 0, coarse = 0;
  for (int y = 0; y < camera.height; y += kRowStride) {
    const std::uint32_t* row = &color[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width)];
    for (int x = 0; x + kCoarse < camera.width; ++x) {
      const float here = brightness_of(row[x]);
      fine += static_cast<double>(std::abs(brightness_of(row[x + kFine]) - here));
      coarse += static_cast<double>(std::abs(brightness_of(row[x + kCoarse]) - here));
    }
  }
  return coarse > 0 ? fine / coarse : 0;
}

double mean_of(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// Shift of `now` against `before` in samples; the number of samples if no shift fits; nullopt for a flat profile.
std::optional<int> shift_between(const std::vector<float>& before, const std::vector<float>& now) {
  if (before.size() != now.size() || now.empty()) return std::nullopt;
  const int n = static_cast<int>(now.size()), max_shift = static_cast<int>(kMaxShift * n);
  const double mean_before = mean_of(before), mean_now = mean_of(now);
  double variation = 0;
  for (const float v : now) variation += std::abs(static_cast<double>(v) - mean_now) / n;
  const auto cost = [&](int shift) {
    double sum = 0;
    const int begin = std::max(0, -shift), end = std::min(n, n - shift);
    for (int i = begin; i < end; ++i)
      sum += std::abs((static_cast<double>(before[static_cast<std::size_t>(i + shift)]) - mean_before) -
                      (static_cast<double>(now[static_cast<std::size_t>(i)]) - mean_now));
    return sum / (end - begin);
  };
  int best = 0;
  double min_cost = cost(0);
  const double cost_at_rest = min_cost;
  for (int shift = -max_shift; shift <= max_shift; ++shift)
    if (const double c = cost(shift); c < min_cost) min_cost = c, best = shift;
  if (variation < kMinVariation * mean_now) return std::nullopt;
  if (min_cost > kMaxDissimilarity * variation) return n;
  return min_cost < kMaxCostRatio * cost_at_rest ? best : 0;
}

}  // namespace

double ViewStep::length() const { return std::hypot(right, down); }

ViewProfile profile_of(const Frame& frame, const Rig& rig) {
  ViewProfile profile;
  if (const Camera& camera = rig.color_view(); frame.color.size() == pixels_of(camera)) {
    average(
        camera,
        [&](int x, int y) {
          return brightness_of(frame.color[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) +
                                           static_cast<std::size_t>(x)]);
        },
        profile);
    profile.brightness = mean_of(profile.columns);
    profile.sharpness = sharpness_of(frame.color, camera);
  } else if (frame.depth.size() == pixels_of(rig.depth)) {
    average(
        rig.depth,
        [&](int x, int y) {
          return frame.depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(rig.depth.width) +
                             static_cast<std::size_t>(x)];
        },
        profile);
  }
  return profile;
}

std::optional<ViewStep> step_between(const ViewProfile& before, const ViewProfile& now) {
  const auto right = shift_between(before.columns, now.columns), down = shift_between(before.rows, now.rows);
  if (!right && !down) return std::nullopt;
  ViewStep step{.right = right.value_or(0) / static_cast<double>(now.columns.size()),
                .down = down.value_or(0) / static_cast<double>(now.rows.size())};
  // A sideways rotation also changes the rows, so a row mismatch is ignored if the columns match.
  if (right && step.right < 1 && step.down == 1) step.down = 0;
  if (down && step.down < 1 && step.right == 1) step.right = 0;
  return step;
}

}  // namespace cairn
