// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <optional>
#include <unordered_map>
#include <vector>

#include "floor_plan/contours.hpp"
#include "floor_plan/grid.hpp"

namespace cairn::plan {

/// Spatial index of the sides of many polylines.
class SegmentIndex {
 public:
  explicit SegmentIndex(const std::vector<Polyline>& lines);
  [[nodiscard]] const std::vector<Segment>& all() const { return sides_; }
  /// Sorted indices of sides possibly in a box.
  [[nodiscard]] std::vector<std::size_t> near(const Box& box) const;

  struct Hit {
    std::size_t side = 0;
    double distance = 0;  // meters
  };
  /// First side hit by a ray within `max_distance` meters, except `excluded`. `along`: unit length.
  [[nodiscard]] std::optional<Hit> first(const Point& from, const Point& along, double max_distance,
                                         std::size_t excluded) const;

 private:
  void visit(const Box& box, const std::function<void(const cv::Point& bucket)>& at) const;
  std::vector<Segment> sides_;
  struct Hash {
    std::size_t operator()(const cv::Point& p) const {  // Teschner et al. 2003
      return static_cast<std::size_t>(p.x) * 73856093u ^ static_cast<std::size_t>(p.y) * 19349669u;
    }
  };
  std::unordered_map<cv::Point, std::vector<std::size_t>, Hash> buckets_;
};

/// Unit normal, towards the adjacent free space.
[[nodiscard]] inline Point normal_of(const Segment& side) { return left_of(side.b - side.a).normalized(); }

}  // namespace cairn::plan
