// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "cairn/eval/evaluation.hpp"

namespace cairn {
namespace {

constexpr double kOnSurface = 1e-3;                          // meters
constexpr double kMinStep = 5e-3;                            // meters; bounds the number of steps of rays along a wall
constexpr int kMaxVisibilityTests = 8;                       // maximum number of visibility tests per cell column
constexpr int kStride = 8;                                   // pixels between rays
constexpr double kMinTranslation = 0.1, kMinRotation = 0.1;  // minimum motion between views, meters and radians
constexpr double kMaxSurfaceDistance = 1.5;  // cells: an occupied cell must have a surface within this distance
constexpr double kObservedThickness = 2;     // cells: depth behind an observed surface that counts as observed

/// Depth of a ray's first intersection with the surface, along z of the camera; nullopt beyond `max_depth` meters.
std::optional<double> depth_along(const Scene& scene, const Eigen::Isometry3d& world_from_camera,
                                  const Eigen::Vector3d& ray, double max_depth) {
  const double length = ray.norm();
  for (double z = 0; z < max_depth;) {
    const double distance = scene.distance(world_from_camera * (z * ray));
    if (distance < kOnSurface) return z;
    z += std::max(distance, kMinStep) / length;
  }
  return std::nullopt;
}

/// Returns true if the motion exceeds the minimum between views.
bool exceeds_keyframe_distance(const Eigen::Isometry3d& motion) {
  return motion.translation().norm() > kMinTranslation || Eigen::AngleAxisd(motion.linear()).angle() > kMinRotation;
}

/// Depth images rendered from the poses with sufficient motion between them, at every kStride-th pixel.
class Views {
 public:
  Views(const Scene& scene, const Camera& camera, const Trajectory& poses, const SurfaceOptions& range)
      : camera_(camera),
        range_(range),
        columns_((camera.width - 1) / kStride + 1),
        rows_((camera.height - 1) / kStride + 1) {
    for (const auto& [time, pose] : poses)
      if (views_.empty() || exceeds_keyframe_distance(views_.back().camera_from_world * pose))
        views_.push_back({pose.inverse(), {}});
    tbb::parallel_for(std::size_t{0}, views_.size(), [&](std::size_t i) {
      View& view = views_[i];
      const Eigen::Isometry3d pose = view.camera_from_world.inverse();
      view.depth.reserve(static_cast<std::size_t>(columns_ * rows_));
      for (int row = 0; row < rows_; ++row)
        for (int column = 0; column < columns_; ++column) {
          const Eigen::Vector3d ray((column * kStride - camera.cx) / camera.fx, (row * kStride - camera.cy) / camera.fy,
                                    1);
          const auto depth = depth_along(scene, pose, ray, static_cast<double>(range.max_depth));
          view.depth.push_back(depth && *depth >= static_cast<double>(range.min_depth) ? static_cast<float>(*depth)
                                                                                       : 0);
        }
    });
  }

  /// Returns true if a camera has free space at a point: all four adjacent rays end behind it. `hint`: index of the
  /// last matching view, tested first.
  [[nodiscard]] bool sees_free_space(const Eigen::Vector3d& point, std::size_t& hint) const {
    return any(point, hint, [](float z, auto depths) { return std::ranges::min(depths) > z; });
  }

  /// Returns true if a camera sees a surface point: an adjacent ray ends behind it, or at most `tolerance` in front.
  [[nodiscard]] bool sees_surface(const Eigen::Vector3d& point, double tolerance, std::size_t& hint) const {
    return any(point, hint, [tolerance](float z, auto depths) {
      return std::ranges::max(depths) > z - static_cast<float>(tolerance);
    });
  }

 private:
  /// Returns true if a view contains the point and `holds` is true for the depths of the four adjacent rays.
  template <class Holds>
  [[nodiscard]] bool any(const Eigen::Vector3d& point, std::size_t& hint, const Holds& holds) const {
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const std::size_t k = (hint + i) % views_.size();
      const Eigen::Vector3d p = views_[k].camera_from_world * point;
      if (p.z() <= 0 || p.z() > static_cast<double>(range_.max_depth)) continue;
      const Eigen::Vector2d pixel = camera_.project(p) / kStride;
      if (pixel.minCoeff() < 0 || pixel.x() >= columns_ - 1 || pixel.y() >= rows_ - 1) continue;
      const float* depth =
          &views_[k]
               .depth[static_cast<std::size_t>(static_cast<int>(pixel.y()) * columns_ + static_cast<int>(pixel.x()))];
      if (!holds(static_cast<float>(p.z()), std::array{depth[0], depth[1], depth[columns_], depth[columns_ + 1]}))
        continue;
      hint = k;
      return true;
    }
    return false;
  }

  struct View {
    Eigen::Isometry3d camera_from_world;
    std::vector<float> depth;  // meters; 0: no measurement
  };
  Camera camera_;
  SurfaceOptions range_;
  int columns_, rows_;
  std::vector<View> views_;
};

}  // namespace

CostmapError evaluate_costmap(const Costmap& costmap, const Scene& scene, const Camera& camera, const Trajectory& poses,
                              const SurfaceOptions& range) {
  if (poses.empty()) throw std::runtime_error("the evaluation of a costmap needs camera poses, but there are none");
  const Views views(scene, camera, poses, range);
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
      const auto at = [&](double ratio) {
        return Eigen::Vector3d(x, -(costmap.low + ratio * (costmap.high - costmap.low)), z);
      };
      double nearest = std::numeric_limits<double>::infinity();
      for (int i = 0; i < levels; ++i) nearest = std::min(nearest, scene.distance(at((i + 0.5) / levels)));
      if (cell == Costmap::Cell::occupied) {
        ++e.judged;
        ++(nearest <= kMaxSurfaceDistance * size ? e.right : e.wrongly_occupied);
        continue;
      }
      if (cell == Costmap::Cell::free && nearest < 0) {
        bool is_seen = false;
        for (int i = 0; i < levels && !is_seen; ++i)
          if (const Eigen::Vector3d point = at((i + 0.5) / levels); scene.distance(point) < 0)
            is_seen = views.sees_surface(point, kObservedThickness * size, hint);
        is_seen ? ++e.judged, ++e.wrongly_free : ++e.hidden;
        continue;
      }
      if (cell == Costmap::Cell::unknown && nearest <= 0.5 * size) continue;  // correct: may be occupied
      const int tests = std::min(levels, kMaxVisibilityTests);
      int seen = 0;
      for (int i = 0; i < tests; ++i) seen += views.sees_free_space(at((i + 0.5) / tests), hint);
      const bool is_half_seen = 2 * seen >= tests;
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
    all.judged += e.judged, all.right += e.right, all.unseen += e.unseen, all.hidden += e.hidden;
    all.wrongly_free += e.wrongly_free, all.wrongly_occupied += e.wrongly_occupied;
    all.wrongly_unknown += e.wrongly_unknown;
  }
  return all;
}

}  // namespace cairn
