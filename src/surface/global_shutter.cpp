// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "surface/global_shutter.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace cairn {
namespace {

constexpr int kIterations = 3;        // each leaves a hundredth of the error of the one before
constexpr double kOneSurface = 0.03;  // of the depth, between four pixels that are averaged
constexpr double kFarAway = 3;        // metres, where nothing is measured at all

}  // namespace

MotionAt at_velocity(const Vector6d& velocity) {
  return [velocity](double delay) { return retract(velocity * delay); };
}

GlobalShutter::Rays::Rays(const Camera& c) : camera(c) {
  if (!c.distorted() || c.readout == 0) return;
  at.resize(static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height));
  tbb::parallel_for(0, c.height, [&](int y) {
    for (int x = 0; x < c.width; ++x)
      at[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x)] =
          c.undistorted_ray(x, y).cast<float>();
  });
}

Eigen::Vector2d GlobalShutter::Rays::of(const Eigen::Vector2d& pixel) const {
  const Camera& c = camera;
  if (at.empty()) return {(pixel.x() - c.cx) / c.fx, (pixel.y() - c.cy) / c.fy};
  const int x = std::clamp(static_cast<int>(std::lround(pixel.x())), 0, c.width - 1);
  const int y = std::clamp(static_cast<int>(std::lround(pixel.y())), 0, c.height - 1);
  return at[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x)]
             .cast<double>() +
         Eigen::Vector2d((pixel.x() - x) / c.fx, (pixel.y() - y) / c.fy);
}

Eigen::Vector2d GlobalShutter::Rays::project(const Eigen::Vector3d& p) const {
  const Camera& c = camera;
  const Eigen::Vector2d n = p.head<2>() / p.z();
  const Eigen::Vector2d bent = c.distorted() ? c.distort(n) : n;
  return {c.fx * bent.x() + c.cx, c.fy * bent.y() + c.cy};
}

/// Where in the rolling image a pixel of the global one is found.
class GlobalShutter::Warp {
 public:
  /// `depth`: of the camera's own image, or empty: `distance` everywhere.
  Warp(const Rays& rays, const MotionAt& motion, const std::vector<float>* depth, double distance)
      : rays_(rays), depth_(depth), distance_(distance) {
    for (int y = 0; y < rays.camera.height; ++y) now_from_row_.push_back(motion(rays.camera.row_delay(y)));
  }
  struct Found {
    Eigen::Vector2d pixel;  // in the rolling image
    Eigen::Isometry3d const* now_from_row;
  };
  [[nodiscard]] Found find(int x, int y) const {
    const Camera& c = rays_.camera;
    const Eigen::Vector2d wanted(x, y);
    Eigen::Vector2d pixel = wanted;
    const Eigen::Isometry3d* moved = nullptr;
    for (int i = 0; i < kIterations; ++i) {
      const int row = std::clamp(static_cast<int>(std::lround(pixel.y())), 0, c.height - 1);
      moved = &now_from_row_[static_cast<std::size_t>(row)];
      const Eigen::Vector3d point = *moved * (distance_at(pixel) * rays_.of(pixel).homogeneous());
      if (!(point.z() > 1e-3)) break;
      pixel += wanted - rays_.project(point);
    }
    return {pixel, moved};
  }

 private:
  [[nodiscard]] double distance_at(const Eigen::Vector2d& pixel) const {
    if (depth_ == nullptr) return distance_;
    const Camera& c = rays_.camera;
    const int x = std::clamp(static_cast<int>(std::lround(pixel.x())), 0, c.width - 1);
    const int y = std::clamp(static_cast<int>(std::lround(pixel.y())), 0, c.height - 1);
    const float z =
        (*depth_)[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x)];
    return z > 0 ? static_cast<double>(z) : distance_;
  }
  const Rays& rays_;
  const std::vector<float>* depth_;
  double distance_;
  std::vector<Eigen::Isometry3d> now_from_row_;
};

GlobalShutter::GlobalShutter(const Rig& rig) : rig_(rig), depth_(rig.depth), colour_(rig.colour_view()) {}

double GlobalShutter::difference(const MotionAt& a, const MotionAt& b) const {
  const double half = 0.5 * std::max(rig_.depth.readout, rig_.colour_view().readout);
  double most = 0;
  for (const double delay : {-half, half}) {
    const Vector6d d = local_coordinates(a(delay).inverse() * b(delay));
    most = std::max(most, rig_.depth.fx * (d.head<3>().norm() + d.tail<3>().norm()));
  }
  return most;
}

namespace {

/// Four pixels around a place, and how much each counts.
struct Corners {
  std::array<std::size_t, 4> at;
  std::array<double, 4> weight;
};

bool corners_of(const Camera& c, const Eigen::Vector2d& pixel, Corners& corners) {
  if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= c.width - 1 && pixel.y() <= c.height - 1)) return false;
  const int x = std::min(static_cast<int>(pixel.x()), c.width - 2),
            y = std::min(static_cast<int>(pixel.y()), c.height - 2);
  const double u = pixel.x() - x, v = pixel.y() - y;
  const auto width = static_cast<std::size_t>(c.width);
  const std::size_t first = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
  corners.at = {first, first + 1, first + width, first + width + 1};
  corners.weight = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
  return true;
}

/// Between pixels of one surface the inverse depth is linear; else it is the nearest pixel's.
double depth_between(const std::vector<float>& depth, const Corners& corners) {
  double least = 1e9, most = 0, inverse = 0;
  std::size_t nearest = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto z = static_cast<double>(depth[corners.at[k]]);
    least = std::min(least, z), most = std::max(most, z);
    if (z > 0) inverse += corners.weight[k] / z;
    if (corners.weight[k] > corners.weight[nearest]) nearest = k;
  }
  if (least > 0 && most - least < kOneSurface * least) return 1 / inverse;
  return static_cast<double>(depth[corners.at[nearest]]);
}

std::uint32_t colour_between(const std::vector<std::uint32_t>& colour, const Corners& corners) {
  std::uint32_t out = 0xff000000u;
  for (int shift = 0; shift < 24; shift += 8) {
    double sum = 0.5;
    for (std::size_t k = 0; k < 4; ++k)
      sum += corners.weight[k] * static_cast<double>(colour[corners.at[k]] >> shift & 0xff);
    out |= static_cast<std::uint32_t>(sum) << shift;
  }
  return out;
}

/// Half of the measurements are nearer; of every 37th pixel.
double median_of(const std::vector<float>& depth) {
  std::vector<float> some;
  for (std::size_t i = 0; i < depth.size(); i += 37)
    if (depth[i] > 0) some.push_back(depth[i]);
  if (some.empty()) return kFarAway;
  const auto middle = some.begin() + static_cast<std::ptrdiff_t>(some.size() / 2);
  std::nth_element(some.begin(), middle, some.end());
  return static_cast<double>(*middle);
}

}  // namespace

Frame GlobalShutter::operator()(const Frame& frame, const MotionAt& motion) const {
  Frame global = frame;
  const double distance = median_of(frame.depth);
  const auto for_each_pixel = [](const Camera& c, const auto& visit) {
    tbb::parallel_for(0, c.height, [&](int y) {
      for (int x = 0; x < c.width; ++x)
        visit(x, y, static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x));
    });
  };
  const bool is_registered = !rig_.colour && frame.colour.size() == frame.depth.size();
  if (rig_.depth.readout > 0) {
    const Warp warp(depth_, motion, &frame.depth, distance);
    for_each_pixel(rig_.depth, [&](int x, int y, std::size_t i) {
      const auto found = warp.find(x, y);
      Corners corners{};
      global.depth[i] = 0;
      if (is_registered) global.colour[i] = 0xff000000u;
      if (!corners_of(rig_.depth, found.pixel, corners)) return;
      if (is_registered) global.colour[i] = colour_between(frame.colour, corners);
      const double z = depth_between(frame.depth, corners);
      if (z > 0)
        global.depth[i] =
            static_cast<float>(std::max((*found.now_from_row * (z * depth_.of(found.pixel).homogeneous())).z(), 0.0));
    });
  }
  if (!rig_.colour || rig_.colour->camera.readout == 0 || frame.colour.empty()) return global;
  const Eigen::Isometry3d colour_from_depth = rig_.colour->colour_from_depth,
                          depth_from_colour = rig_.depth_from_colour();
  const MotionAt colours = [&](double delay) -> Eigen::Isometry3d {
    return colour_from_depth * motion(delay) * depth_from_colour;
  };
  const Warp warp(colour_, colours, nullptr, distance);
  for_each_pixel(colour_.camera, [&](int x, int y, std::size_t i) {
    Corners corners{};
    global.colour[i] = corners_of(colour_.camera, warp.find(x, y).pixel, corners)
                           ? colour_between(frame.colour, corners)
                           : 0xff000000u;
  });
  return global;
}

}  // namespace cairn
