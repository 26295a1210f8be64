// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "bundle/view.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace cairn {
namespace {

constexpr double kMinFocalLength = 400;      // pixels; min. focal length of reduced color images
constexpr int kNormalRadius = 4;             // pixels to each side for a normal
constexpr double kMaxPlaneResidual = 2;      // max. residual of a plane in standard deviations of depth (RMS)
constexpr double kMaxDepthSpread = 6;        // max. depth difference of neighbors in standard deviations of depth
constexpr double kSmoothing = 1;             // pixels, standard deviation of the brightness filter
constexpr double kMinRayCosine = 0.3;        // cosine of a normal with its ray
constexpr int kBlock = 4, kMinMeasured = 3;  // depth pixels per block; min. number of measured ones

std::size_t pixels(const Camera& c) { return static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height); }

/// Pixel of a camera's own image that corresponds to a pixel of the rectified image.
struct Pixel {
  int x, y;
};
Pixel measured(const Camera& own, int x, int y) {
  if (!own.distorted()) return {x, y};
  const Eigen::Vector2d bent = own.distort(own.ray(x, y).head<2>());
  return {static_cast<int>(std::lround(own.fx * bent.x() + own.cx)),
          static_cast<int>(std::lround(own.fy * bent.y() + own.cy))};
}

/// Mean of four measurements, if they are of one surface; else 0.
float mean_depth(const BundleCameras& cameras, const std::vector<float>& depth, int x, int y) {
  const Camera& own = cameras.rig.depth;
  const SensorModel& sensor = cameras.rig.sensor;
  float sum = 0, min_z = sensor.max_depth, max_z = 0;
  int count = 0;
  for (int k = 0; k < kBlock; ++k) {
    const Pixel p = measured(own, 2 * x + (k & 1), 2 * y + (k >> 1));
    if (p.x < 0 || p.y < 0 || p.x >= own.width || p.y >= own.height) continue;
    const float z = depth[at(own, p.x, p.y)];
    if (!(z >= sensor.min_depth && z <= sensor.max_depth)) continue;
    sum += z, ++count;
    min_z = std::min(min_z, z), max_z = std::max(max_z, z);
  }
  if (count < kMinMeasured) return 0;
  const float z = sum / static_cast<float>(count);
  return static_cast<double>(max_z - min_z) > kMaxDepthSpread * static_cast<double>(sensor.sigma(z)) ? 0 : z;
}

/// Plane normals from each pixel's neighborhood: inverse depth is linear in image coordinates, with uniform noise.
class Planes {
 public:
  Planes(const BundleCameras& cameras, const std::vector<float>& depth)
      : camera_(cameras.depth), sensor_(cameras.rig.sensor), depth_(depth) {
    cv::Mat valid(camera_.height, camera_.width, CV_64F), inverse(valid.size(), CV_64F);
    for (int y = 0; y < camera_.height; ++y)
      for (int x = 0; x < camera_.width; ++x) {
        const auto z = static_cast<double>(depth[at(camera_, x, y)]);
        valid.at<double>(y, x) = z > 0 ? 1 : 0;
        inverse.at<double>(y, x) = z > 0 ? 1 / z : 0;
      }
    cv::Mat one(1, 2 * kNormalRadius + 1, CV_64F, 1), first(one.size(), CV_64F), second(one.size(), CV_64F);
    for (int i = -kNormalRadius; i <= kNormalRadius; ++i) {
      first.at<double>(i + kNormalRadius) = i;
      second.at<double>(i + kNormalRadius) = i * i;
    }
    const auto sum = [](const cv::Mat& image, const cv::Mat& across, const cv::Mat& down) {
      cv::Mat result;
      cv::sepFilter2D(image, result, CV_64F, across, down);
      return result;
    };
    count_ = sum(valid, one, one);
    x_ = sum(valid, first, one), y_ = sum(valid, one, first);
    xx_ = sum(valid, second, one), xy_ = sum(valid, first, first), yy_ = sum(valid, one, second);
    inverse_ = sum(inverse, one, one);
    inverse_x_ = sum(inverse, first, one), inverse_y_ = sum(inverse, one, first);
    squared_ = sum(inverse.mul(inverse), one, one);
  }

  [[nodiscard]] std::optional<Eigen::Vector3d> normal_at(int x, int y) const {
    const auto z = static_cast<double>(depth_[at(camera_, x, y)]);
    if (!(z > 0)) return std::nullopt;
    const auto of = [&](const cv::Mat& sums) { return sums.at<double>(y, x); };
    constexpr int kAll = (2 * kNormalRadius + 1) * (2 * kNormalRadius + 1);
    const double count = of(count_), here = 1 / z;
    if (3 * count < 2 * kAll) return std::nullopt;
    Eigen::Matrix3d information;
    information << of(xx_), of(xy_), of(x_), of(xy_), of(yy_), of(y_), of(x_), of(y_), count;
    // Inverse depth relative to the center's.
    const Eigen::Vector3d sum(of(inverse_x_) - here * of(x_), of(inverse_y_) - here * of(y_),
                              of(inverse_) - here * count);
    const double squared = of(squared_) - 2 * here * of(inverse_) + here * here * count;
    const Eigen::Vector3d slope = information.inverse() * sum;
    const double sigma = static_cast<double>(sensor_.sigma(static_cast<float>(z))) / (z * z);
    if (squared - slope.dot(sum) > count * kMaxPlaneResidual * kMaxPlaneResidual * sigma * sigma) return std::nullopt;
    // The plane's points have 1/z = m . ray.
    const Eigen::Vector3d ray = camera_.ray(x, y);
    Eigen::Vector3d m(slope.x() * camera_.fx, slope.y() * camera_.fy, 0);
    m.z() = here + slope.z() - m.dot(ray);
    const Eigen::Vector3d n = -m.normalized();
    if (-n.dot(ray.normalized()) < kMinRayCosine) return std::nullopt;
    return n;
  }

 private:
  const Camera& camera_;
  const SensorModel& sensor_;
  const std::vector<float>& depth_;
  // Sums over the pixels with depth in each neighborhood: count, offsets, and inverse depth.
  cv::Mat count_, x_, y_, xx_, xy_, yy_, inverse_, inverse_x_, inverse_y_, squared_;
};

std::uint8_t mean_brightness(const BundleCameras& cameras, const std::vector<std::uint32_t>& color, int x, int y) {
  const Camera& own = cameras.rig.color_view();
  const int block = 1 << cameras.color_level;
  std::uint32_t sum = 0;
  for (int j = 0; j < block; ++j)
    for (int i = 0; i < block; ++i) {
      const Pixel p = measured(own, block * x + i, block * y + j);
      const std::uint32_t rgba = color[at(own, std::clamp(p.x, 0, own.width - 1), std::clamp(p.y, 0, own.height - 1))];
      sum += (rgba & 255) + 2 * (rgba >> 8 & 255) + (rgba >> 16 & 255);
    }
  const auto parts = static_cast<std::uint32_t>(4 * block * block);
  return static_cast<std::uint8_t>((sum + parts / 2) / parts);
}

}  // namespace

BundleCameras::BundleCameras(const Rig& r) : rig(r), depth(r.depth.rectified().at_level(1)) {
  const Camera full = r.color_view().rectified();
  while (full.at_level(color_level + 1).fx > kMinFocalLength) ++color_level;
  color = full.at_level(color_level);
}

Eigen::Vector2f BundleCameras::measured_at(int x, int y) const {
  const Camera& own = rig.depth;
  Eigen::Vector2d pixel(2 * x + 0.5, 2 * y + 0.5);  // center of the block
  if (own.distorted()) {
    const Eigen::Vector2d bent = own.distort(depth.ray(x, y).head<2>());
    pixel = {own.fx * bent.x() + own.cx, own.fy * bent.y() + own.cy};
  }
  return ((pixel.array() + 0.5) / Eigen::Array2d(own.width, own.height)).cast<float>();
}

BundleView bundle_view(const BundleCameras& cameras, const Frame& frame, const CameraMotion& motion) {
  BundleView view;
  view.motion = motion;
  view.color_delay = frame.color_delay;
  const Camera &depth = cameras.depth, &color = cameras.color;
  view.depth.resize(pixels(depth));
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) view.depth[at(depth, x, y)] = mean_depth(cameras, frame.depth, x, y);
  view.farthest = *std::max_element(view.depth.begin(), view.depth.end());
  view.normals.assign(pixels(depth), Eigen::Vector3f::Zero());
  const Planes planes(cameras, view.depth);
  for (int y = kNormalRadius; y + kNormalRadius < depth.height; ++y)
    for (int x = kNormalRadius; x + kNormalRadius < depth.width; ++x)
      if (const auto n = planes.normal_at(x, y)) view.normals[at(depth, x, y)] = n->cast<float>();
  if (frame.color.empty()) return view;
  view.brightness.resize(pixels(color));
  for (int y = 0; y < color.height; ++y)
    for (int x = 0; x < color.width; ++x)
      view.brightness[at(color, x, y)] = mean_brightness(cameras, frame.color, x, y);
  // Detail too fine for interpolation would bind views to their current poses.
  cv::Mat image(color.height, color.width, CV_8U, view.brightness.data());
  cv::GaussianBlur(image, image, cv::Size(0, 0), kSmoothing);
  return view;
}

}  // namespace cairn
