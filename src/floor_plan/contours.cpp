// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/contours.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "floor_plan/storeys.hpp"

namespace cairn::plan {
namespace {

/// Point where an edge crosses the height: the same for both triangles at the edge.
Point crossing(Eigen::Vector3d a, Eigen::Vector3d b, double height) {
  if (std::lexicographical_compare(b.data(), b.data() + 3, a.data(), a.data() + 3)) std::swap(a, b);
  const Eigen::Vector3d p = a + (height - height_of(a)) / (height_of(b) - height_of(a)) * (b - a);
  return {p.x(), p.z()};
}

using Key = std::pair<std::int64_t, std::int64_t>;
/// Key of a point, equal for points that differ only by rounding.
Key key_of(const Point& p) {
  constexpr double kResolution = 1e-5;  // meters
  return {std::llround(p.x() / kResolution), std::llround(p.y() / kResolution)};
}
struct KeyHash {
  std::size_t operator()(const Key& k) const {  // Teschner et al. 2003
    return static_cast<std::size_t>(k.first) * 73856093u ^ static_cast<std::size_t>(k.second) * 19349669u;
  }
};

bool before(const Segment& s, const Segment& t) {
  return std::make_tuple(s.a.x(), s.a.y(), s.b.x(), s.b.y()) < std::make_tuple(t.a.x(), t.a.y(), t.b.x(), t.b.y());
}

/// Successor of each segment; a segment has at most one successor and one predecessor.
class Links {
 public:
  explicit Links(const std::vector<Segment>& segments) : next_(segments.size(), kNone), first_(segments.size(), true) {
    std::unordered_map<Key, std::vector<std::size_t>, KeyHash> starting_at;
    for (std::size_t i = segments.size(); i-- > 0;) starting_at[key_of(segments[i].a)].push_back(i);
    for (std::size_t i = 0; i < segments.size(); ++i) {
      const auto at = starting_at.find(key_of(segments[i].b));
      if (at == starting_at.end() || at->second.empty()) continue;
      next_[i] = at->second.back();
      first_[next_[i]] = false;
      at->second.pop_back();
    }
  }
  static constexpr std::size_t kNone = ~std::size_t{0};
  [[nodiscard]] std::size_t next(std::size_t i) const { return next_[i]; }
  [[nodiscard]] bool is_first(std::size_t i) const { return first_[i]; }

 private:
  std::vector<std::size_t> next_;
  std::vector<bool> first_;
};

}  // namespace

void cut(const Mesh& mesh, double height, std::vector<Segment>& segments) {
  for (const auto& t : mesh.triangles) {
    std::array<Eigen::Vector3d, 3> corners;
    std::array<bool, 3> above{};
    for (std::size_t i = 0; i < 3; ++i) {
      corners[i] = mesh.positions[t[i]].cast<double>();
      above[i] = height_of(corners[i]) >= height;
    }
    if (above[0] == above[1] && above[1] == above[2]) continue;
    std::array<Point, 2> ends;
    for (std::size_t i = 0, n = 0; i < 3; ++i)
      if (const std::size_t k = (i + 1) % 3; above[i] != above[k]) ends[n++] = crossing(corners[i], corners[k], height);
    const Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (left_of(ends[1] - ends[0]).dot(Point(normal.x(), normal.z())) < 0) std::swap(ends[0], ends[1]);
    if (key_of(ends[0]) != key_of(ends[1])) segments.push_back({ends[0], ends[1]});
  }
}

std::vector<Polyline> joined(std::vector<Segment> segments) {
  std::sort(segments.begin(), segments.end(), before);
  const Links links(segments);
  std::vector<bool> taken(segments.size(), false);
  std::vector<Polyline> lines;
  const auto follow = [&](std::size_t i) {
    Polyline& line = lines.emplace_back();
    line.points.push_back(segments[i].a);
    for (std::size_t at = i; at != Links::kNone; at = links.next(at)) {
      if (taken[at]) {  // closed
        line.closed = true;
        line.points.pop_back();
        break;
      }
      taken[at] = true;
      line.points.push_back(segments[at].b);
    }
  };
  for (const bool open : {true, false})
    for (std::size_t i = 0; i < segments.size(); ++i)
      if (!taken[i] && (!open || links.is_first(i))) follow(i);
  return lines;
}

}  // namespace cairn::plan
