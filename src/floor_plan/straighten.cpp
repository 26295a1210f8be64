// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/straighten.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace cairn::plan {
namespace {

constexpr double kMaxDeviation = 1.5;  // voxels between a straight run and its contour
constexpr double kTrim =
    2.0;  // voxels at each end of a run excluded from its fit, a quarter at most: corners are rounded
constexpr double kMinFitLength = 2.5;                       // voxels: shorter runs keep their ends
constexpr double kMinFitRatio = 0.25;                       // share of a run used for its fit
constexpr double kMinContourSize = 0.1;                     // meters: smallest bounding box of a drawn contour
constexpr double kMinDirectionLength = 0.3;                 // meters: smallest run for the estimation of the direction
constexpr double kMaxAngle = 2.0 * std::numbers::pi / 180;  // radians from the direction, at most, for a rotation of a
                                                            // run
constexpr double kMaxMove = 1.0;                            // voxels of motion of its ends by the rotation, at most
constexpr double kMaxShortAngle = 15 * std::numbers::pi / 180, kMaxShortMove = 0.5;  // the same for shorter runs
constexpr double kMaxLineDistance = 0.5;    // voxels between two lines drawn as one
constexpr double kMinAlignedRatio = 0.5;    // share of the long runs' length along the direction
constexpr double kMinCornerSine = 0.25;     // sine of the smallest angle of a corner between two runs
constexpr double kMaxCornerDistance = 3.0;  // voxels between a corner and the contour's turn
constexpr double kRightAngle = std::numbers::pi / 2;

/// Straight line and its drawn part.
struct Run {
  Point middle = Point::Zero(), along = Point::UnitX();  // unit length
  double length = 0;
  Point begin = Point::Zero(), end = Point::Zero();  // turning points of the contour
  bool turned = false;                               // to the direction of most walls

  [[nodiscard]] Point nearest(const Point& p) const { return middle + along * along.dot(p - middle); }
  [[nodiscard]] double angle() const { return std::atan2(along.y(), along.x()); }
};

/// Adds the indices of kept points, including the first and the last.
void keep_between(const std::vector<Point>& points, std::size_t first, std::size_t last, double distance,
                  std::vector<std::size_t>& kept) {
  std::vector<std::pair<std::size_t, std::size_t>> open{{first, last}};
  kept.push_back(first);
  while (!open.empty()) {
    const auto [i, k] = open.back();
    open.pop_back();
    std::size_t farthest = i;
    double max_distance = distance;
    for (std::size_t m = i + 1; m < k; ++m)
      if (const double d = distance_to(points[m], points[i], points[k]); d > max_distance)
        max_distance = d, farthest = m;
    if (farthest == i) {
      kept.push_back(k);
    } else {
      open.emplace_back(farthest, k);
      open.emplace_back(i, farthest);
    }
  }
}

/// The same contour from a turning point on, with its first point repeated at its end.
std::vector<Point> opened(const Polyline& line) {
  std::vector<Point> points = line.points;
  if (!line.closed) return points;
  Point middle = Point::Zero();
  for (const Point& p : points) middle += p / static_cast<double>(points.size());
  const auto farthest = std::max_element(points.begin(), points.end(), [&](const Point& a, const Point& b) {
    return (a - middle).squaredNorm() < (b - middle).squaredNorm();
  });
  std::rotate(points.begin(), farthest, points.end());
  points.push_back(points.front());
  return points;
}

/// Least-squares line through a part of a contour.
Run fitted(const std::vector<Point>& points, std::size_t first, std::size_t last, double voxel) {
  Run run{.begin = points[first], .end = points[last]};
  const Point chord = run.end - run.begin;
  run.length = chord.norm();
  run.middle = (run.begin + run.end) / 2;
  if (run.length <= 0) return run;
  run.along = chord / run.length;
  if (run.length < kMinFitLength * voxel) return run;
  const double trim = std::min(kTrim * voxel, run.length / 4);
  double weight = 0;
  Point sum = Point::Zero();
  Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
  for (std::size_t i = first; i < last; ++i) {
    const Point p = (points[i] + points[i + 1]) / 2 - run.begin;
    const double at = run.along.dot(p), w = (points[i + 1] - points[i]).norm();
    if (at < trim || at > run.length - trim) continue;
    weight += w;
    sum += w * p;
    moments += w * p * p.transpose();
  }
  if (weight < kMinFitRatio * run.length) return run;
  const Point mean = sum / weight;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(moments / weight - mean * mean.transpose());
  const Point along = axes.eigenvectors().col(1);
  run.along = along.dot(run.along) < 0 ? Point(-along) : along;
  run.middle = run.begin + mean;
  return run;
}

/// Consecutive straight runs of a contour.
std::vector<Run> runs_of(const std::vector<Point>& points, double voxel) {
  std::vector<std::size_t> kept;
  keep_between(points, 0, points.size() - 1, kMaxDeviation * voxel, kept);
  std::vector<Run> runs;
  for (std::size_t i = 0; i + 1 < kept.size(); ++i) runs.push_back(fitted(points, kept[i], kept[i + 1], voxel));
  return runs;
}

/// Smallest angle from a direction or its perpendicular to another: -pi / 4 to pi / 4.
double angle_from(double direction, double angle) { return std::remainder(angle - direction, kRightAngle); }

/// Finds the main direction, and its share of the long runs' length.
void find_direction(const std::vector<std::vector<Run>>& contours, StraightLines& lines) {
  std::vector<std::pair<double, double>> directions;  // angle, length
  double all = 0;
  for (const auto& runs : contours)
    for (const Run& run : runs)
      if (run.length >= kMinDirectionLength) {
        directions.emplace_back(run.angle(), run.length);
        all += run.length;
      }
  constexpr int kSteps = 360;  // a quarter of a degree
  double best = 0, max_votes = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double direction = i * kRightAngle / kSteps;
    double votes = 0;
    for (const auto& [angle, length] : directions)
      votes += length * std::max(0.0, 1 - std::abs(angle_from(direction, angle)) / kMaxAngle);
    if (votes > max_votes) max_votes = votes, best = direction;
  }
  double length = 0, turn = 0;
  for (const auto& [angle, l] : directions)
    if (const double off = angle_from(best, angle); std::abs(off) <= kMaxAngle) length += l, turn += l * off;
  if (length <= 0) return;
  lines.share = length / all;
  lines.direction = std::fmod(best + turn / length + kRightAngle, kRightAngle);
}

/// Rotates a run about its middle into the direction if the change is small.
void turn_to(double direction, double voxel, Run& run) {
  const double off = angle_from(direction, run.angle());
  const bool is_short = run.length < kMinDirectionLength;
  if (std::abs(off) > (is_short ? kMaxShortAngle : kMaxAngle)) return;
  if (run.length / 2 * std::sin(std::abs(off)) > (is_short ? kMaxShortMove : kMaxMove) * voxel) return;
  // One of four values, so that aligned runs are exactly parallel.
  const auto quarter = std::lround((run.angle() - off - direction) / kRightAngle);
  Point along(std::cos(direction), std::sin(direction));
  for (long i = 0; i < ((quarter % 4) + 4) % 4; ++i) along = left_of(along);
  run.along = along;
  run.turned = true;
}

/// Merges neighboring rotated runs that are nearly collinear.
std::vector<Run> merged(const std::vector<Run>& runs, double voxel) {
  std::vector<Run> all;
  for (const Run& run : runs) {
    if (all.empty() || !all.back().turned || !run.turned || all.back().along != run.along ||
        (all.back().nearest(run.middle) - run.middle).norm() > kMaxLineDistance * voxel) {
      all.push_back(run);
      continue;
    }
    Run& last = all.back();
    last.middle = (last.length * last.middle + run.length * run.middle) / (last.length + run.length);
    last.length += run.length;
    last.end = run.end;
  }
  return all;
}

/// Adds the corner between two runs.
void add_corner(const Run& a, const Run& b, double voxel, std::vector<Point>& points) {
  const double sine = cross(a.along, b.along);
  const Point on_a = a.nearest(a.end), on_b = b.nearest(a.end);
  if (std::abs(sine) >= kMinCornerSine) {
    const Point corner = a.middle + a.along * (cross(b.middle - a.middle, b.along) / sine);
    if ((corner - a.end).norm() <= kMaxCornerDistance * voxel) return points.push_back(corner);
  } else if ((on_a - on_b).norm() < kMaxLineDistance * voxel) {
    return points.push_back((on_a + on_b) / 2);
  }
  points.push_back(on_a);
  points.push_back(on_b);
}

Polyline line_of(const std::vector<Run>& runs, bool closed, double voxel) {
  Polyline line{.points = {}, .closed = closed && runs.size() > 2};
  if (!line.closed) line.points.push_back(runs.front().nearest(runs.front().begin));
  for (std::size_t i = 0; i + 1 < runs.size(); ++i) add_corner(runs[i], runs[i + 1], voxel, line.points);
  if (line.closed)
    add_corner(runs.back(), runs.front(), voxel, line.points);
  else
    line.points.push_back(runs.back().nearest(runs.back().end));
  return line;
}

/// Distances of a contour's segments from their replacement line, with their lengths. Both have the same orientation:
/// only sides near the previous nearest side are searched.
void measure(const std::vector<Point>& points, const Polyline& line, std::vector<std::pair<double, double>>& offs) {
  constexpr std::size_t kSearchedSides = 6;
  const std::size_t sides = line.sides();
  if (sides == 0) return;
  std::size_t at = 0;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const Point p = (points[i] + points[i + 1]) / 2;
    double min_distance = std::numeric_limits<double>::infinity();
    std::size_t nearest = at;
    const std::size_t begin = line.closed ? at + sides - 2 : at < 2 ? 0 : at - 2;
    for (std::size_t k = begin; k < begin + kSearchedSides && (line.closed || k < sides); ++k)
      if (const double d = distance_to(p, line.begin_of(k % sides), line.end_of(k % sides)); d < min_distance)
        min_distance = d, nearest = k % sides;
    at = nearest;
    offs.emplace_back(min_distance, (points[i + 1] - points[i]).norm());
  }
}

void summarize(std::vector<std::pair<double, double>> offs, StraightLines& lines) {
  std::sort(offs.begin(), offs.end());
  double sum = 0;
  for (const auto& [off, length] : offs) lines.length += length, sum += off * length;
  if (lines.length <= 0) return;
  lines.mean_off = sum / lines.length;
  lines.max_off = offs.back().first;
  double left = 0.95 * lines.length;
  for (const auto& [off, length] : offs)
    if ((left -= length) <= 0) {
      lines.p95_off = off;
      break;
    }
}

bool is_speck(const Polyline& contour) {
  Box box;
  for (const Point& p : contour.points) box.extend(p);
  return box.diagonal().norm() < kMinContourSize;
}

}  // namespace

double distance_to(const Point& p, const Point& a, const Point& b) {
  const Point ab = b - a;
  const double squared = ab.squaredNorm();
  const double t = squared > 0 ? std::clamp((p - a).dot(ab) / squared, 0.0, 1.0) : 0.0;
  return (p - a - t * ab).norm();
}

Polyline simplified(const Polyline& line, double distance) {
  if (line.points.size() < 3) return line;
  const std::vector<Point> points = opened(line);
  std::vector<std::size_t> kept;
  keep_between(points, 0, points.size() - 1, distance, kept);
  if (line.closed) kept.pop_back();
  Polyline simple{.points = {}, .closed = line.closed};
  for (const std::size_t i : kept) simple.points.push_back(points[i]);
  return simple;
}

StraightLines straightened(const std::vector<Polyline>& contours, double voxel) {
  std::vector<std::vector<Point>> kept;
  std::vector<bool> closed;
  std::vector<std::vector<Run>> runs;
  for (const Polyline& contour : contours) {
    if (is_speck(contour)) continue;
    kept.push_back(opened(contour));
    closed.push_back(contour.closed);
    runs.push_back(runs_of(kept.back(), voxel));
  }
  StraightLines straight;
  find_direction(runs, straight);
  std::vector<std::pair<double, double>> offs;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (straight.share >= kMinAlignedRatio)
      for (Run& run : runs[i]) turn_to(straight.direction, voxel, run);
    straight.lines.push_back(line_of(merged(runs[i], voxel), closed[i], voxel));
    measure(kept[i], straight.lines.back(), offs);
  }
  summarize(std::move(offs), straight);
  return straight;
}

}  // namespace cairn::plan
