// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "cairn/evaluation.hpp"

namespace cairn {
namespace {

constexpr double kOnSurface = 1e-3;  // metres
constexpr int kMostLooks = 8;        // points of a cell's column that are asked whether a camera saw them
constexpr double kAway = 1.5;        // cells: farther from every surface a cell is not occupied

/// How far a ray goes, along z of the camera, until it meets a surface; nothing beyond `most` metres.
std::optional<double> depth_along(const Scene& scene, const Eigen::Isometry3d& world_from_camera,
                                  const Eigen::Vector3d& ray, double most) {
  const double length = ray.norm();
  for (double z = 0; z < most;) {
    const double distance = scene.distance(world_from_camera * (z * ray));
    if (distance < kOnSurface) return z;
    z += distance / length;
  }
  return std::nullopt;
}

/// Whether a camera at one of the poses looks through a point. `hint`: the pose that saw the last one, and is asked
/// first.
bool is_seen(const Scene& scene, const Eigen::Vector3d& point, const Camera& camera, const Trajectory& poses,
             const SurfaceOptions& range, std::size_t& hint) {
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::size_t k = (hint + i) % poses.size();
    const Eigen::Isometry3d& pose = poses[k].world_from_camera;
    const Eigen::Vector3d p = pose.inverse() * point;
    if (p.z() <= 0 || p.z() > static_cast<double>(range.max_depth)) continue;
    const Eigen::Vector2d pixel = camera.project(p);
    if (pixel.minCoeff() < 0 || pixel.x() > camera.width - 1 || pixel.y() > camera.height - 1) continue;
    const auto depth = depth_along(scene, pose, p / p.z(), static_cast<double>(range.max_depth));
    if (!depth || *depth < static_cast<double>(range.min_depth) || *depth <= p.z()) continue;
    hint = k;
    return true;
  }
  return false;
}

}  // namespace

CostmapError evaluate_costmap(const Costmap& costmap, const Scene& scene, const Camera& camera, const Trajectory& poses,
                              const SurfaceOptions& range) {
  if (poses.empty()) throw std::runtime_error("a costmap is judged by where the camera was: no pose is given");
  const double size = costmap.resolution;
  const int levels = std::max(1, static_cast<int>(std::lround((costmap.high - costmap.low) / size)));
  std::vector<CostmapError> by_row(static_cast<std::size_t>(costmap.rows));
  tbb::parallel_for(0, costmap.rows, [&](int row) {
    CostmapError& e = by_row[static_cast<std::size_t>(row)];
    std::size_t hint = 0;
    for (int column = 0; column < costmap.columns; ++column) {
      const Costmap::Cell cell = costmap.cells[static_cast<std::size_t>(row * costmap.columns + column)];
      // ROS axes: x is the world's z, y its -x, up its -y.
      const double x = -(costmap.origin.y() + (costmap.rows - 1 - row + 0.5) * size),
                   z = costmap.origin.x() + (column + 0.5) * size;
      const auto at = [&](double share) {
        return Eigen::Vector3d(x, -(costmap.low + share * (costmap.high - costmap.low)), z);
      };
      double nearest = std::numeric_limits<double>::infinity();
      for (int i = 0; i < levels; ++i) nearest = std::min(nearest, scene.distance(at((i + 0.5) / levels)));
      if (cell == Costmap::Cell::occupied) {
        ++e.judged;
        ++(nearest <= kAway * size ? e.right : e.wrongly_occupied);
        continue;
      }
      if (cell == Costmap::Cell::free && nearest < 0) {
        ++e.judged, ++e.wrongly_free;
        continue;
      }
      if (cell == Costmap::Cell::unknown && nearest <= 0.5 * size) continue;  // may be occupied: nobody is misled
      const int looks = std::min(levels, kMostLooks);
      int seen = 0;
      for (int i = 0; i < looks; ++i) seen += is_seen(scene, at((i + 0.5) / looks), camera, poses, range, hint);
      const bool is_half_seen = 2 * seen >= looks;
      if (cell == Costmap::Cell::free) {
        ++e.judged, ++e.right;
        e.unseen += seen == 0;
      } else if (is_half_seen) {
        ++e.judged, ++e.wrongly_unknown;
      }
    }
  });
  CostmapError all;
  for (const CostmapError& e : by_row) {
    all.judged += e.judged, all.right += e.right, all.unseen += e.unseen;
    all.wrongly_free += e.wrongly_free, all.wrongly_occupied += e.wrongly_occupied;
    all.wrongly_unknown += e.wrongly_unknown;
  }
  return all;
}

}  // namespace cairn
