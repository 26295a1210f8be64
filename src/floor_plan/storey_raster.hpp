// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "floor_plan/contours.hpp"
#include "floor_plan/grid.hpp"

namespace cairn::plan {

/// Survey of a storey, collected part by part: add each part of the surface once.
class StoreyRaster {
 public:
  /// `floor`: meters above the world's origin; `cut`: height above the floor at which walls are cut.
  StoreyRaster(const Grid& grid, double floor, double cut);
  /// Adds a part of the map's surface, in the world.
  void add(const Mesh& mesh);
  /// Marks a cell with free space at the cut.
  void mark_free(const cv::Point& cell) { free_(cell) = 255; }
  /// Marks a point with observed free space or surface between the floor and the cut.
  void mark_seen(const Point& p) {
    constexpr int kMargin = Grid::kMargin;  // stays empty, as for free space
    const cv::Point c = grid_.cell_of(p);
    if (c.x >= kMargin && c.y >= kMargin && c.x < grid_.width - kMargin && c.y < grid_.height - kMargin) seen_(c) = 255;
  }

  [[nodiscard]] const Grid& grid() const { return grid_; }
  /// Meters above the world's origin.
  [[nodiscard]] double floor() const { return floor_; }
  [[nodiscard]] double cut_height() const { return floor_ + cut_; }
  [[nodiscard]] const std::vector<Segment>& segments() const { return segments_; }
  [[nodiscard]] const Mask& seen_floor() const { return seen_floor_; }
  /// Upward-facing surface between the floor and the cut.
  [[nodiscard]] const Mask& furniture() const { return furniture_; }
  [[nodiscard]] const Mask& free() const { return free_; }
  [[nodiscard]] const Mask& seen() const { return seen_; }

 private:
  Grid grid_;
  double floor_, cut_;
  std::vector<Segment> segments_;
  Mask seen_floor_, furniture_, free_, seen_;
};

}  // namespace cairn::plan
