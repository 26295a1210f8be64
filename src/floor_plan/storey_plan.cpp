// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/storey_plan.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace cairn::plan {
namespace {

constexpr double kMaxPinhole = 0.03;  // meters: closes smaller holes in observed areas, and removes smaller strips
constexpr double kMinArea = 0.02;     // m2 of furniture, of observed floor, or of unobserved area

cv::Mat disc(const Grid& grid, double radius) {
  const int size = 2 * grid.cells(radius) + 1;
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {size, size});
}

Mask with_closed_holes(const Grid& grid, const Mask& mask) {
  Mask closed;
  cv::morphologyEx(mask, closed, cv::MORPH_CLOSE, disc(grid, kMaxPinhole));
  return closed;
}

Mask without_strips(const Grid& grid, const Mask& mask) {
  Mask opened;
  cv::morphologyEx(mask, opened, cv::MORPH_OPEN, disc(grid, kMaxPinhole));
  return opened;
}

}  // namespace

std::vector<Area> polygons_of(const Grid& grid, const Mask& mask, Edges edges) {
  std::vector<std::vector<cv::Point>> rings;
  std::vector<cv::Vec4i> order;  // next, previous, first child, parent
  cv::findContours(mask, rings, order, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
  const auto drawn = [&](int i) {
    Polyline line{.points = {}, .closed = true};
    for (const cv::Point& c : rings[static_cast<std::size_t>(i)]) line.points.push_back(grid.center(c));
    if (edges == Edges::straight)
      if (const StraightLines straight = straightened({line}, grid.cell); !straight.lines.empty())
        return straight.lines.front().points;
    return simplified(line, grid.cell).points;
  };
  std::vector<Area> areas;
  for (int i = 0; i < static_cast<int>(rings.size()); ++i) {
    const cv::Vec4i& place = order[static_cast<std::size_t>(i)];
    if (place[3] >= 0 || cv::contourArea(rings[static_cast<std::size_t>(i)]) * grid.cell * grid.cell < kMinArea)
      continue;
    Area& area = areas.emplace_back(Area{drawn(i)});
    for (int hole = place[2]; hole >= 0; hole = order[static_cast<std::size_t>(hole)][0]) area.push_back(drawn(hole));
  }
  return areas;
}

namespace {

/// Unobserved cells enclosed by observed cells.
Mask unobserved_within(const Mask& observed) {
  Mask outside = observed.clone();
  cv::floodFill(outside, cv::Point(0, 0), 255);  // the margin is empty
  return ~outside;
}

/// Computes the unobserved area and its share of the floor.
void compute_coverage(const StoreyRaster& raster, const Mask& open, const Mask& walls, StoreyPlan& plan) {
  constexpr double kMaxWallDepth = 0.15;  // meters: strips up to twice as wide are the depth of walls with a single
                                          // observed face
  const Grid& grid = raster.grid();
  const Mask observed = with_closed_holes(grid, open | raster.seen()) & ~walls;
  const Mask outline = within_outline(grid, observed | walls, plan.walls.direction);
  Mask unobserved = outline & ~(observed | walls);
  cv::morphologyEx(unobserved, unobserved, cv::MORPH_OPEN, disc(grid, kMaxWallDepth));
  plan.unseen = polygons_of(grid, unobserved);
  const double area = cv::countNonZero(unobserved), all = area + cv::countNonZero(observed);
  plan.unobserved_area = area * grid.cell * grid.cell;
  plan.unobserved_share = all > 0 ? area / all : 0;
}

/// Moves the corners of filled areas to adjacent lines.
void snap(const SegmentIndex& sides, double max_distance, std::vector<Area>& areas) {
  for (Area& area : areas)
    for (auto& ring : area)
      for (Point& p : ring) {
        const Point from = p;
        double corner = max_distance, line = max_distance;
        for (const std::size_t i :
             sides.near({from - Point::Constant(max_distance), from + Point::Constant(max_distance)})) {
          const Segment& side = sides.all()[i];
          for (const Point& end : {side.a, side.b})
            if (const double d = (end - from).norm(); d < corner) corner = d, p = end;
          if (const double d = distance_to(from, side.a, side.b); d < line && corner >= max_distance) {
            line = d;
            const Point along = (side.b - side.a).normalized();
            p = side.a + along * std::clamp(along.dot(from - side.a), 0.0, (side.b - side.a).norm());
          }
        }
      }
}

}  // namespace

StoreyPlan plan_of(const StoreyRaster& raster, double voxel, Coverage coverage) {
  constexpr double kSnapDistance = 2.5;  // cells
  const Grid& grid = raster.grid();
  StoreyPlan plan{
      .floor = raster.floor(), .height = kNominalHeight, .walls = straightened(joined(raster.segments()), voxel)};
  const SegmentIndex sides(plan.walls.lines);
  const Mask solid = solid_between(raster, sides);
  Mask lines = grid.mask();
  for (const Segment& side : sides.all()) cv::line(lines, grid.cell_of(side.a), grid.cell_of(side.b), 255);
  const Mask walls = solid | lines;
  const Mask furniture = without_strips(grid, with_closed_holes(grid, raster.furniture()) & ~solid);
  const Mask floor = with_closed_holes(grid, raster.seen_floor()) & ~solid;
  const Mask open = with_closed_holes(grid, floor | furniture | raster.free()) & ~walls;
  Mask thick;
  cv::dilate(solid, thick, cv::Mat());
  plan.solid = polygons_of(grid, thick);
  snap(sides, kSnapDistance * grid.cell, plan.solid);
  plan.floors = polygons_of(grid, floor);
  plan.furniture = polygons_of(grid, furniture, Edges::straight);
  if (coverage == Coverage::included)
    compute_coverage(raster, open, walls, plan);
  else
    plan.unseen = polygons_of(grid, without_strips(grid, unobserved_within(open | walls)));
  plan.doors = doors_between(grid, solid, sides);
  plan.rooms = rooms_in(grid, open, walls, plan.doors);
  for (Room& room : plan.rooms) {
    std::vector<Area> outline{std::move(room.outline)};
    snap(sides, kSnapDistance * grid.cell, outline);
    room.outline = std::move(outline.front());
  }
  plan.floor_area = cv::countNonZero((floor | furniture) & ~walls) * grid.cell * grid.cell;
  return plan;
}

}  // namespace cairn::plan
