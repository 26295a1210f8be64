// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "adjust/view.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace cairn {
namespace {

constexpr double kShortest = 200;  // pixels; the focal length that colour images are reduced to, or a little more
constexpr int kReach = 4;          // pixels to each side that a normal is made of
constexpr double kFlat = 2;        // standard deviations of depth (RMS) that they may lie off their plane
constexpr double kOneSurface = 6;  // standard deviations of depth that neighbours may differ by
constexpr double kSmoothing = 1;   // pixels, standard deviation, of brightness
constexpr double kSteepest = 0.3;  // cosine of a normal to its ray
constexpr int kBlock = 4, kMeasured = 3;  // depth pixels in one; at least so many of them

std::size_t pixels(const Camera& c) { return static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height); }

/// The pixel of a camera's own image that one of its rectified image shows.
struct Pixel {
  int x, y;
};
Pixel measured(const Camera& own, int x, int y) {
  if (!own.distorted()) return {x, y};
  const Eigen::Vector2d bent = own.distort(own.ray(x, y).head<2>());
  return {static_cast<int>(std::lround(own.fx * bent.x() + own.cx)),
          static_cast<int>(std::lround(own.fy * bent.y() + own.cy))};
}

/// The mean of four measurements, where they are of one surface.
float mean_depth(const BundleCameras& cameras, const std::vector<float>& depth, int x, int y) {
  const Camera& own = cameras.rig.depth;
  const SensorModel& sensor = cameras.rig.sensor;
  float sum = 0, least = sensor.max_depth, most = 0;
  int count = 0;
  for (int k = 0; k < kBlock; ++k) {
    const Pixel p = measured(own, 2 * x + (k & 1), 2 * y + (k >> 1));
    if (p.x < 0 || p.y < 0 || p.x >= own.width || p.y >= own.height) continue;
    const float z = depth[at(own, p.x, p.y)];
    if (!(z >= sensor.min_depth && z <= sensor.max_depth)) continue;
    sum += z, ++count;
    least = std::min(least, z), most = std::max(most, z);
  }
  if (count < kMeasured) return 0;
  const float z = sum / static_cast<float>(count);
  return static_cast<double>(most - least) > kOneSurface * static_cast<double>(sensor.sigma(z)) ? 0 : z;
}

/// Of the plane through the pixels around one: inverse depth is linear over its image, and noise is alike in it.
std::optional<Eigen::Vector3d> normal_at(const BundleCameras& cameras, const std::vector<float>& depth, int x, int y) {
  const Camera& c = cameras.depth;
  const auto here = static_cast<double>(depth[at(c, x, y)]);
  if (!(here > 0)) return std::nullopt;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squared = 0;
  int count = 0;
  for (int j = -kReach; j <= kReach; ++j)
    for (int i = -kReach; i <= kReach; ++i) {
      const auto z = static_cast<double>(depth[at(c, x + i, y + j)]);
      if (!(z > 0)) continue;
      const Eigen::Vector3d place(i, j, 1);
      const double off = 1 / z - 1 / here;
      information.noalias() += place * place.transpose();
      sum += off * place, squared += off * off;
      ++count;
    }
  constexpr int kAll = (2 * kReach + 1) * (2 * kReach + 1);
  if (3 * count < 2 * kAll) return std::nullopt;
  const Eigen::Vector3d slope = information.inverse() * sum;
  const double sigma = static_cast<double>(cameras.rig.sensor.sigma(static_cast<float>(here))) / (here * here);
  if (squared - slope.dot(sum) > count * kFlat * kFlat * sigma * sigma) return std::nullopt;
  // The plane's points have 1/z = m . ray.
  const Eigen::Vector3d ray = c.ray(x, y);
  Eigen::Vector3d m(slope.x() * c.fx, slope.y() * c.fy, 0);
  m.z() = 1 / here + slope.z() - m.dot(ray);
  const Eigen::Vector3d n = -m.normalized();
  if (-n.dot(ray.normalized()) < kSteepest) return std::nullopt;
  return n;
}

std::uint8_t mean_brightness(const BundleCameras& cameras, const std::vector<std::uint32_t>& colour, int x, int y) {
  const Camera& own = cameras.rig.colour_view();
  const int block = 1 << cameras.colour_level;
  std::uint32_t sum = 0;
  for (int j = 0; j < block; ++j)
    for (int i = 0; i < block; ++i) {
      const Pixel p = measured(own, block * x + i, block * y + j);
      const std::uint32_t rgba = colour[at(own, std::clamp(p.x, 0, own.width - 1), std::clamp(p.y, 0, own.height - 1))];
      sum += (rgba & 255) + 2 * (rgba >> 8 & 255) + (rgba >> 16 & 255);
    }
  const auto parts = static_cast<std::uint32_t>(4 * block * block);
  return static_cast<std::uint8_t>((sum + parts / 2) / parts);
}

}  // namespace

BundleCameras::BundleCameras(const Rig& r) : rig(r), depth(r.depth.rectified().at_level(1)) {
  const Camera whole = r.colour_view().rectified();
  while (whole.at_level(colour_level + 1).fx > kShortest) ++colour_level;
  colour = whole.at_level(colour_level);
}

Eigen::Vector2f BundleCameras::measured_at(int x, int y) const {
  const Camera& own = rig.depth;
  Eigen::Vector2d pixel(2 * x + 0.5, 2 * y + 0.5);  // the middle of the block
  if (own.distorted()) {
    const Eigen::Vector2d bent = own.distort(depth.ray(x, y).head<2>());
    pixel = {own.fx * bent.x() + own.cx, own.fy * bent.y() + own.cy};
  }
  return ((pixel.array() + 0.5) / Eigen::Array2d(own.width, own.height)).cast<float>();
}

BundleView bundle_view(const BundleCameras& cameras, const Frame& frame, const CameraMotion& motion) {
  BundleView view;
  view.motion = motion;
  view.colour_delay = frame.colour_delay;
  const Camera &depth = cameras.depth, &colour = cameras.colour;
  view.depth.resize(pixels(depth));
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) view.depth[at(depth, x, y)] = mean_depth(cameras, frame.depth, x, y);
  view.farthest = *std::max_element(view.depth.begin(), view.depth.end());
  view.normals.assign(pixels(depth), Eigen::Vector3f::Zero());
  for (int y = kReach; y + kReach < depth.height; ++y)
    for (int x = kReach; x + kReach < depth.width; ++x)
      if (const auto n = normal_at(cameras, view.depth, x, y)) view.normals[at(depth, x, y)] = n->cast<float>();
  if (frame.colour.empty()) return view;
  view.brightness.resize(pixels(colour));
  for (int y = 0; y < colour.height; ++y)
    for (int x = 0; x < colour.width; ++x)
      view.brightness[at(colour, x, y)] = mean_brightness(cameras, frame.colour, x, y);
  // Detail that cannot be interpolated would hold views where they are.
  cv::Mat image(colour.height, colour.width, CV_8U, view.brightness.data());
  cv::GaussianBlur(image, image, cv::Size(0, 0), kSmoothing);
  return view;
}

}  // namespace cairn
