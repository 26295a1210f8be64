// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "floor_plan/storey_plan.hpp"

namespace cairn::plan {
namespace {

constexpr double kMaxThickness = 0.6;       // meters of a wall
constexpr double kMaxOpposedCosine = -0.8;  // cosine between the normals of a wall's two faces, at most
constexpr double kMinWallRatio = 0.4;       // share of wall in a gap's rim

/// Marks the cells from one point to another, unless free space is between the points.
void mark_between(const StoreyRaster& raster, const Point& a, const Point& b, Mask& solid) {
  constexpr double kMargin = 2.5;  // cells at each end that may seem free
  const Grid& grid = raster.grid();
  const double length = (b - a).norm(), beside = std::min(kMargin * grid.cell, length / 2);
  const int steps = static_cast<int>(std::ceil(2 * length / grid.cell));
  std::vector<cv::Point> cells;
  for (int i = 0; i <= steps; ++i) {
    const double at = length * i / steps;
    const cv::Point cell = grid.cell_of(a + (b - a) * (at / length));
    if (!grid.contains(cell)) continue;
    if (at > beside && at < length - beside && raster.free()(cell) != 0) return;
    cells.push_back(cell);
  }
  for (const cv::Point& cell : cells) solid(cell) = 255;
}

/// Fills gaps where walls meet: small and enclosed by walls.
void fill_gaps(const StoreyRaster& raster, const SegmentIndex& sides, Mask& solid) {
  const Grid& grid = raster.grid();
  Mask rim = solid.clone();
  for (const Segment& side : sides.all()) cv::line(rim, grid.cell_of(side.a), grid.cell_of(side.b), 255);
  const Mask other = ~(rim | raster.free());
  cv::Mat1i labels, stats;
  cv::Mat1d middles;
  const int count = cv::connectedComponentsWithStats(other, labels, stats, middles, 4);
  for (int i = 1; i < count; ++i) {
    if (stats(i, cv::CC_STAT_AREA) * grid.cell * grid.cell > kMaxThickness * kMaxThickness) continue;
    const cv::Rect box = cv::Rect(stats(i, cv::CC_STAT_LEFT) - 1, stats(i, cv::CC_STAT_TOP) - 1,
                                  stats(i, cv::CC_STAT_WIDTH) + 2, stats(i, cv::CC_STAT_HEIGHT) + 2) &
                         cv::Rect(0, 0, grid.width, grid.height);
    const Mask gap = labels(box) == i;
    Mask around;
    cv::dilate(gap, around, cv::Mat());
    around &= ~gap;
    const int walls = cv::countNonZero(around & solid(box)), all = cv::countNonZero(around);
    if (walls > kMinWallRatio * all) solid(box) |= gap;
  }
}

}  // namespace

Mask solid_between(const StoreyRaster& raster, const SegmentIndex& sides) {
  Mask solid = raster.grid().mask();
  const double step = raster.grid().cell / 2;
  for (std::size_t i = 0; i < sides.all().size(); ++i) {
    const Segment& face = sides.all()[i];
    const Point along = face.b - face.a, normal = normal_of(face);
    const int steps = static_cast<int>(std::ceil(along.norm() / step));
    for (int k = 0; k < steps; ++k) {
      const Point from = face.a + along * ((k + 0.5) / steps);
      const auto hit = sides.first(from, -normal, kMaxThickness, i);
      if (hit && normal_of(sides.all()[hit->side]).dot(normal) < kMaxOpposedCosine)
        mark_between(raster, from, from - normal * hit->distance, solid);
    }
  }
  fill_gaps(raster, sides, solid);
  return solid;
}

}  // namespace cairn::plan
