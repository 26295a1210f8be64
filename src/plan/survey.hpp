// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/mesh.hpp"
#include "plan/contours.hpp"
#include "plan/grid.hpp"

namespace cairn::plan {

/// What a map shows of a storey, gathered part by part: each part of the surface is added once.
class Survey {
 public:
  /// `floor`: metres above the world's origin; `cut`: above the floor, where walls are cut.
  Survey(const Grid& grid, double floor, double cut);
  /// Adds a part of the map's surface, in the world.
  void add(const Mesh& mesh);
  /// A cell has free space where walls are cut.
  void mark_free(const cv::Point& cell) { free_(cell) = 255; }
  /// Free space or a surface was seen over a point, between the floor and the cut.
  void mark_seen(const Point& p) {
    constexpr int kMargin = Grid::kMargin;  // stays empty, as with free space
    const cv::Point c = grid_.cell_of(p);
    if (c.x >= kMargin && c.y >= kMargin && c.x < grid_.width - kMargin && c.y < grid_.height - kMargin) seen_(c) = 255;
  }

  [[nodiscard]] const Grid& grid() const { return grid_; }
  /// Metres above the world's origin.
  [[nodiscard]] double floor() const { return floor_; }
  [[nodiscard]] double cut_height() const { return floor_ + cut_; }
  [[nodiscard]] const std::vector<Segment>& segments() const { return segments_; }
  [[nodiscard]] const Mask& seen_floor() const { return seen_floor_; }
  /// Surface that faces up between the floor and the cut.
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
