// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Frame of a floor plan: (x, z) of the world, meters. Seen from above, x points right and z up the page.
#pragma once
#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

namespace cairn::plan {

using Point = Eigen::Vector2d;
using Box = Eigen::AlignedBox2d;
using Mask = cv::Mat1b;  // one byte per cell, 0 or 255; row by row along x

/// Vector rotated by 90 degrees to the left.
[[nodiscard]] inline Point left_of(const Point& p) { return {-p.y(), p.x()}; }
[[nodiscard]] inline double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Points connected by straight lines.
struct Polyline {
  std::vector<Point> points;
  bool closed = false;

  [[nodiscard]] std::size_t sides() const { return points.size() < 2 ? 0 : closed ? points.size() : points.size() - 1; }
  [[nodiscard]] const Point& begin_of(std::size_t side) const { return points[side]; }
  [[nodiscard]] const Point& end_of(std::size_t side) const { return points[(side + 1) % points.size()]; }
  [[nodiscard]] double length() const {
    double sum = 0;
    for (std::size_t i = 0; i < sides(); ++i) sum += (end_of(i) - begin_of(i)).norm();
    return sum;
  }
};

/// Area bounded by rings, with the even-odd rule.
using Area = std::vector<std::vector<Point>>;

/// Square cells for the survey of a storey.
struct Grid {
  Point origin = Point::Zero();  // lowest corner of cell (0, 0)
  double cell = 0;               // meters a side
  int width = 0, height = 0;     // cells

  /// Grid around a box with cells of at least `cell` meters; larger ones if there would be more than kMaxCells.
  [[nodiscard]] static Grid around(const Box& box, double cell) {
    constexpr double kMaxCells = 1 << 26;
    while (box.volume() / (cell * cell) > kMaxCells) cell *= 2;
    const Point extent = (box.sizes() / cell).array().ceil() + 2 * kMargin;
    return {box.min() - Point::Constant(kMargin * cell), cell, static_cast<int>(extent.x()),
            static_cast<int>(extent.y())};
  }
  [[nodiscard]] cv::Point cell_of(const Point& p) const {
    const Point at = ((p - origin) / cell).array().floor();
    return {static_cast<int>(at.x()), static_cast<int>(at.y())};
  }
  [[nodiscard]] Point center(const cv::Point& c) const { return origin + cell * Point(c.x + 0.5, c.y + 0.5); }
  [[nodiscard]] bool contains(const cv::Point& c) const { return c.x >= 0 && c.y >= 0 && c.x < width && c.y < height; }
  [[nodiscard]] Mask mask() const { return Mask::zeros(height, width); }
  /// Number of cells for a length, at least one.
  [[nodiscard]] int cells(double meters) const { return std::max(1, static_cast<int>(std::lround(meters / cell))); }

  static constexpr int kMargin = 4;  // empty cells on each side
};

}  // namespace cairn::plan
