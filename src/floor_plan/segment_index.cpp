// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/segment_index.hpp"

#include <algorithm>
#include <cmath>

namespace cairn::plan {
namespace {

constexpr double kBucket = 0.5;  // meters

Box box_of(const Point& a, const Point& b) {
  Box box(a);
  return box.extend(b);
}

}  // namespace

SegmentIndex::SegmentIndex(const std::vector<Polyline>& lines) {
  for (const Polyline& line : lines)
    for (std::size_t i = 0; i < line.sides(); ++i)
      if (line.begin_of(i) != line.end_of(i)) sides_.push_back({line.begin_of(i), line.end_of(i)});
  for (std::size_t i = 0; i < sides_.size(); ++i)
    visit(box_of(sides_[i].a, sides_[i].b), [&](const cv::Point& bucket) { buckets_[bucket].push_back(i); });
}

void SegmentIndex::visit(const Box& box, const std::function<void(const cv::Point&)>& at) const {
  const Point low = (box.min() / kBucket).array().floor(), high = (box.max() / kBucket).array().floor();
  for (int y = static_cast<int>(low.y()); y <= static_cast<int>(high.y()); ++y)
    for (int x = static_cast<int>(low.x()); x <= static_cast<int>(high.x()); ++x) at({x, y});
}

std::vector<std::size_t> SegmentIndex::near(const Box& box) const {
  std::vector<std::size_t> found;
  visit(box, [&](const cv::Point& bucket) {
    if (const auto it = buckets_.find(bucket); it != buckets_.end())
      found.insert(found.end(), it->second.begin(), it->second.end());
  });
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

std::optional<SegmentIndex::Hit> SegmentIndex::first(const Point& from, const Point& along, double max_distance,
                                                     std::size_t excluded) const {
  std::optional<Hit> hit;
  for (const std::size_t i : near(box_of(from, from + max_distance * along))) {
    const Point to = sides_[i].a - from, side = sides_[i].b - sides_[i].a;
    const double sine = cross(along, side);
    if (i == excluded || sine == 0) continue;
    const double distance = cross(to, side) / sine, share = cross(to, along) / sine;
    if (share < 0 || share > 1 || distance <= 0 || distance > (hit ? hit->distance : max_distance)) continue;
    hit = {.side = i, .distance = distance};
  }
  return hit;
}

}  // namespace cairn::plan
