// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/walls.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "floor_plan/segment_index.hpp"

namespace cairn::plan {
namespace {

constexpr double kMinThickness = 0.02, kMaxThickness = 0.6;  // meters of a wall
constexpr double kMaxOpposedCosine = -0.95;                  // cosine between the normals of two faces, at most
constexpr double kMinFace = 0.3;                             // meters of a single face, at least
constexpr double kMinParallelCosine = 0.99;                  // between pieces of a wall
constexpr double kMaxShift = 0.05;                           // meters between two middle lines, and two thicknesses
constexpr double kMaxJambGap = 0.15;                         // meters between the ends of a door and of a wall
constexpr double kBehind = 0.03;                             // meters behind a face

bool is_inside(const std::vector<Area>& areas, const Point& p) {
  bool inside = false;
  for (const Area& area : areas)
    for (const auto& ring : area)
      for (std::size_t i = 0; i < ring.size(); ++i) {
        const Point &a = ring[i], &b = ring[(i + 1) % ring.size()];
        if ((a.y() > p.y()) != (b.y() > p.y()) && p.x() < a.x() + (b.x() - a.x()) * (p.y() - a.y()) / (b.y() - a.y()))
          inside = !inside;
      }
  return inside;
}

using Interval = std::pair<double, double>;

/// Parts of [0, length] outside the intervals.
std::vector<Interval> gaps_between(std::vector<Interval> intervals, double length) {
  std::sort(intervals.begin(), intervals.end());
  std::vector<Interval> gaps;
  double at = 0;
  for (const auto& [begin, end] : intervals) {
    if (begin > at) gaps.emplace_back(at, begin);
    at = std::max(at, end);
  }
  if (at < length) gaps.emplace_back(at, length);
  return gaps;
}

/// Wall between two opposing faces, with its interval along the first. Empty for other faces.
std::optional<std::pair<Wall, Interval>> between(const StoreyPlan& plan, const Segment& face, const Segment& other) {
  const Point along = (other.b - other.a).norm() > 0 ? Point((face.b - face.a).normalized()) : Point::Zero();
  const Point normal = normal_of(face);
  if (normal_of(other).dot(normal) > kMaxOpposedCosine) return std::nullopt;
  const double thickness = -normal.dot((other.a + other.b) / 2 - face.a);
  const double begin = std::max(0.0, along.dot(other.b - face.a)),
               end = std::min((face.b - face.a).norm(), along.dot(other.a - face.a));
  if (thickness < kMinThickness || thickness > kMaxThickness || end - begin < thickness) return std::nullopt;
  const Point middle = face.a - thickness / 2 * normal;
  if (!is_inside(plan.solid, middle + (begin + end) / 2 * along)) return std::nullopt;
  return std::pair(Wall{.from = middle + begin * along,
                        .to = middle + end * along,
                        .thickness = thickness,
                        .has_two_faces = true,
                        .doors = {}},
                   Interval(begin, end));
}

std::vector<Wall> pieces_of(const StoreyPlan& plan) {
  const SegmentIndex sides(plan.walls.lines);
  const std::vector<Segment>& all = sides.all();
  std::vector<std::vector<Interval>> covered(all.size());
  std::vector<Wall> pieces;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Point behind = -kMaxThickness * normal_of(all[i]);
    Box box;
    for (const Point& p : {all[i].a, all[i].b}) box.extend(p).extend(p + behind);
    for (const std::size_t k : sides.near(box)) {
      if (k <= i) continue;
      const auto wall = between(plan, all[i], all[k]);
      if (!wall) continue;
      pieces.push_back(wall->first);
      covered[i].push_back(wall->second);
      if (const auto opposite = between(plan, all[k], all[i])) covered[k].push_back(opposite->second);
    }
    const Point along = (all[i].b - all[i].a).normalized(), normal = normal_of(all[i]);
    for (const auto& [begin, end] : gaps_between(covered[i], (all[i].b - all[i].a).norm())) {
      // Ends of walls, and faces at crossings, have a solid behind them.
      const Point middle = all[i].a + (begin + end) / 2 * along;
      if (end - begin < kMinFace || is_inside(plan.solid, middle - kBehind * normal)) continue;
      const Point from = all[i].a - kNominalThickness / 2 * normal;
      pieces.push_back({.from = from + begin * along,
                        .to = from + end * along,
                        .thickness = kNominalThickness,
                        .has_two_faces = false,
                        .doors = {}});
    }
  }
  return pieces;
}

/// Interval of a door along a wall's line. Empty for doors beside the line.
std::optional<Interval> along(const Wall& wall, const Segment& door) {
  const Point u = (wall.to - wall.from).normalized();
  const double a = u.dot(door.a - wall.from), b = u.dot(door.b - wall.from);
  for (const Point& p : {door.a, door.b})
    if (std::abs(cross(u, p - wall.from)) > wall.thickness / 2 + kMaxShift) return std::nullopt;
  return std::minmax(a, b);
}

/// Extends a wall along its line to an interval.
void extend(Wall& wall, double begin, double end) {
  const Point u = (wall.to - wall.from).normalized(), from = wall.from;
  const double low = std::min(0.0, begin), high = std::max(wall.length(), end);
  wall.from = from + low * u;
  wall.to = from + high * u;
  for (Wall::Opening& door : wall.doors) door.begin -= low, door.end -= low;
}

/// Adds a door at an end of the wall. Returns false for other doors.
bool add_door(Wall& wall, const Segment& door) {
  const auto at = along(wall, door);
  if (!at) return false;
  const auto [begin, end] = *at;
  if (std::abs(end) > kMaxJambGap && std::abs(begin - wall.length()) > kMaxJambGap) return false;
  const double low = std::min(0.0, begin);
  extend(wall, begin, end);
  wall.doors.push_back({begin - low, end - low});
  return true;
}

/// Joins a second wall in line with the first, if they meet or the gap is solid. Returns false otherwise.
bool join(Wall& wall, const Wall& other, const StoreyPlan& plan) {
  const Point u = (wall.to - wall.from).normalized();
  if (wall.has_two_faces != other.has_two_faces || std::abs(wall.thickness - other.thickness) > kMaxShift ||
      std::abs(u.dot((other.to - other.from).normalized())) < kMinParallelCosine)
    return false;
  for (const Point& p : {other.from, other.to})
    if (std::abs(cross(u, p - wall.from)) > kMaxShift) return false;
  const auto [begin, end] = std::minmax({u.dot(other.from - wall.from), u.dot(other.to - wall.from)});
  const double gap = std::max(begin - wall.length(), -end);
  if (gap > kMaxThickness) return false;
  const double middle = begin > 0 ? wall.length() + gap / 2 : -gap / 2;
  if (gap > kMaxShift && !is_inside(plan.solid, wall.from + middle * u)) return false;
  const bool is_reversed = u.dot(other.to - other.from) < 0;
  const double low = std::min(0.0, begin), first = is_reversed ? end : begin, sign = is_reversed ? -1 : 1;
  std::vector<Wall::Opening> doors;
  for (const Wall::Opening& door : other.doors) {
    const auto [a, b] = std::minmax({first + sign * door.begin, first + sign * door.end});
    doors.push_back({a - low, b - low});
  }
  extend(wall, begin, end);
  for (const Wall::Opening& door : doors)
    if (std::none_of(wall.doors.begin(), wall.doors.end(),
                     [&](const auto& d) { return std::abs(d.begin - door.begin) < kMaxJambGap; }))
      wall.doors.push_back(door);
  return true;
}

}  // namespace

std::vector<Wall> walls_of(const StoreyPlan& plan) {
  std::vector<Wall> walls = pieces_of(plan);
  for (const Segment& door : plan.doors)
    for (Wall& wall : walls)
      if (wall.has_two_faces && add_door(wall, door)) break;
  for (bool any = true; any;) {
    any = false;
    for (std::size_t i = 0; i < walls.size(); ++i)
      for (std::size_t k = walls.size(); k-- > i + 1;)
        if (join(walls[i], walls[k], plan)) {
          walls.erase(walls.begin() + static_cast<std::ptrdiff_t>(k));
          any = true;
        }
  }
  for (Wall& wall : walls)
    std::sort(wall.doors.begin(), wall.doors.end(), [](const auto& a, const auto& b) { return a.begin < b.begin; });
  return walls;
}

}  // namespace cairn::plan
