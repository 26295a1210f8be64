// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/depth_correction.hpp"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "geometry/node_interpolation.hpp"

namespace cairn {
namespace {

constexpr int kMaxNodes = 512;      // maximum nodes per axis
constexpr float kMaxOffset = 1.0f;  // 1/m

}  // namespace

void check(const DepthCorrection& c) {
  if (c.empty() && c.columns == 0 && c.rows == 0) return;
  if (c.columns < 2 || c.rows < 2 || c.columns > kMaxNodes || c.rows > kMaxNodes)
    throw std::runtime_error(
        fmt::format("depth_correction has {} x {} nodes, allowed: 2 to {} per axis", c.columns, c.rows, kMaxNodes));
  if (c.offsets.size() != static_cast<std::size_t>(c.columns) * static_cast<std::size_t>(c.rows))
    throw std::runtime_error(fmt::format("depth_correction has {} offsets, {} columns and {} rows need {}",
                                         c.offsets.size(), c.columns, c.rows, c.columns * c.rows));
  for (const float offset : c.offsets)
    if (!(std::abs(offset) <= kMaxOffset))  // also rejects NaN
      throw std::runtime_error(
          fmt::format("depth_correction has an offset of {}, allowed: -{} to {} 1/m", offset, kMaxOffset, kMaxOffset));
}

float DepthCorrection::at(float x, float y) const {
  if (empty()) return 0;
  const NodeInterpolation across(x, columns), down(y, rows);
  const auto node = [&](int i, int j) { return offsets[static_cast<std::size_t>(j * columns + i)]; };
  const auto row = [&](int j) {
    return node(across.first, j) + across.share * (node(across.first + 1, j) - node(across.first, j));
  };
  const float above = row(down.first);
  return above + down.share * (row(down.first + 1) - above);
}

DepthCorrection DepthCorrection::compose(const DepthCorrection& next) const {
  if (next.empty()) return *this;
  DepthCorrection both =
      empty() ? DepthCorrection{next.columns, next.rows, std::vector<float>(next.offsets.size(), 0)} : *this;
  for (int j = 0; j < both.rows; ++j)
    for (int i = 0; i < both.columns; ++i)
      both.offsets[static_cast<std::size_t>(j * both.columns + i)] +=
          next.at((static_cast<float>(i) + 0.5f) / static_cast<float>(both.columns),
                  (static_cast<float>(j) + 0.5f) / static_cast<float>(both.rows));
  return both;
}

void DepthCorrection::apply(int width, int height, std::vector<float>& depth) const {
  if (empty()) return;
  const auto w = static_cast<std::size_t>(width);
  tbb::parallel_for(tbb::blocked_range<int>(0, height, 32), [&](const tbb::blocked_range<int>& range) {
    std::vector<float> line(static_cast<std::size_t>(columns));
    for (int v = range.begin(); v < range.end(); ++v) {
      const NodeInterpolation down((static_cast<float>(v) + 0.5f) / static_cast<float>(height), rows);
      for (int i = 0; i < columns; ++i) {
        const float above = offsets[static_cast<std::size_t>(down.first * columns + i)],
                    below = offsets[static_cast<std::size_t>((down.first + 1) * columns + i)];
        line[static_cast<std::size_t>(i)] = above + down.share * (below - above);
      }
      float* row = depth.data() + static_cast<std::size_t>(v) * w;
      for (int u = 0; u < width; ++u) {
        const NodeInterpolation across((static_cast<float>(u) + 0.5f) / static_cast<float>(width), columns);
        const float left = line[static_cast<std::size_t>(across.first)],
                    right = line[static_cast<std::size_t>(across.first + 1)];
        row[u] /= 1 + row[u] * (left + across.share * (right - left));
      }
    }
  });
}

}  // namespace cairn
