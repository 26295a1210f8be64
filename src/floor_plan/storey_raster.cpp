// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/storey_raster.hpp"

#include <algorithm>
#include <array>

#include "floor_plan/storeys.hpp"

namespace cairn::plan {
namespace {

constexpr double kFloorTolerance = 0.1;  // meters of unevenness or drift of a floor, to each side
constexpr double kMinUpCosine = 0.5;     // cosine between up and the normal of a surface seen from above

/// Marks the cells with their center under a triangle.
void mark(const Grid& grid, const std::array<Point, 3>& corners, Mask& mask) {
  Box box;
  for (const Point& p : corners) box.extend(p);
  const cv::Point low = grid.cell_of(box.min()), high = grid.cell_of(box.max());
  const double turn = cross(corners[1] - corners[0], corners[2] - corners[0]) < 0 ? -1 : 1;
  for (int y = std::max(0, low.y); y <= std::min(grid.height - 1, high.y); ++y)
    for (int x = std::max(0, low.x); x <= std::min(grid.width - 1, high.x); ++x) {
      const Point p = grid.center({x, y});
      bool inside = true;
      for (std::size_t i = 0; i < 3 && inside; ++i)
        inside = turn * cross(corners[(i + 1) % 3] - corners[i], p - corners[i]) >= 0;
      if (inside) mask(y, x) = 255;
    }
}

}  // namespace

StoreyRaster::StoreyRaster(const Grid& grid, double floor, double cut)
    : grid_(grid),
      floor_(floor),
      cut_(cut),
      seen_floor_(grid.mask()),
      furniture_(grid.mask()),
      free_(grid.mask()),
      seen_(grid.mask()) {}

void StoreyRaster::add(const Mesh& mesh) {
  cut(mesh, cut_height(), segments_);
  for (const auto& t : mesh.triangles) {
    std::array<Eigen::Vector3d, 3> p;
    for (std::size_t i = 0; i < 3; ++i) p[i] = mesh.positions[t[i]].cast<double>();
    const Eigen::Vector3d normal = (p[1] - p[0]).cross(p[2] - p[0]);
    if (-normal.y() < kMinUpCosine * normal.norm()) continue;
    const double above = height_of(Eigen::Vector3d((p[0] + p[1] + p[2]) / 3)) - floor_;
    if (above < -kFloorTolerance || above >= cut_) continue;
    mark(grid_, {Point(p[0].x(), p[0].z()), Point(p[1].x(), p[1].z()), Point(p[2].x(), p[2].z())},
         above <= kFloorTolerance ? seen_floor_ : furniture_);
  }
}

}  // namespace cairn::plan
