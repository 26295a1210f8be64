// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/resample.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace cairn {
namespace {

constexpr float kJump = 0.05f;        // share of the depth, between neighbors on different surfaces
constexpr float kOutside = -1000.0f;  // pixels: outside of every image

/// Positions in `from` of the rays of all pixels of `target`.
cv::Mat2f remap_table(const Camera& target, const Camera& from) {
  cv::Mat2f all(target.height, target.width);
  if (!target.distorted() && !from.distorted()) {
    for (int y = 0; y < all.rows; ++y)
      for (int x = 0; x < all.cols; ++x)
        all(y, x) = cv::Vec2f(static_cast<float>(from.fx * ((x - target.cx) / target.fx) + from.cx),
                              static_cast<float>(from.fy * ((y - target.cy) / target.fy) + from.cy));
    return all;
  }
  const double max_ray = from.widest_ray();
  for (int y = 0; y < all.rows; ++y)
    for (int x = 0; x < all.cols; ++x) {
      const Eigen::Vector2d ray = target.undistorted_ray(x, y);
      const Eigen::Vector2d distorted = from.distort(ray);
      all(y, x) = ray.norm() > max_ray ? cv::Vec2f(kOutside, kOutside)
                                       : cv::Vec2f(static_cast<float>(from.fx * distorted.x() + from.cx),
                                                   static_cast<float>(from.fy * distorted.y() + from.cy));
    }
  return all;
}

/// True if no pixel moves by more than `max_shift` pixels. Without distortion the corners move most.
bool is_equal_within(const Camera& a, const Camera& b, double max_shift) {
  if (a == b) return true;
  if (max_shift <= 0 || a.width != b.width || a.height != b.height || a.lens != b.lens || a.distortion != b.distortion)
    return false;
  for (const int x : {0, a.width - 1})
    for (const int y : {0, a.height - 1}) {
      const Eigen::Vector2d ray((x - a.cx) / a.fx, (y - a.cy) / a.fy);
      if (!(std::hypot(b.fx * ray.x() + b.cx - x, b.fy * ray.y() + b.cy - y) <= max_shift)) return false;
    }
  return true;
}

/// Interpolates depth between pixels. On a plane, inverse depth is linear in the image; across two surfaces the nearest
/// pixel is used.
float depth_between(const cv::Mat1f& depth, float u, float v) {
  const int x = static_cast<int>(std::lround(u)), y = static_cast<int>(std::lround(v));
  if (x < 0 || y < 0 || x >= depth.cols || y >= depth.rows) return 0;
  const int left = std::clamp(static_cast<int>(std::floor(u)), 0, depth.cols - 2),
            top = std::clamp(static_cast<int>(std::floor(v)), 0, depth.rows - 2);
  const float a = depth(top, left), b = depth(top, left + 1), c = depth(top + 1, left), d = depth(top + 1, left + 1);
  const auto [nearest, farthest] = std::minmax({a, b, c, d});
  if (nearest <= 0 || farthest - nearest > kJump * nearest) return depth(y, x);
  const float s = std::clamp(u - static_cast<float>(left), 0.0f, 1.0f),
              t = std::clamp(v - static_cast<float>(top), 0.0f, 1.0f);
  return 1 / ((1 - t) * ((1 - s) / a + s / b) + t * ((1 - s) / c + s / d));
}

}  // namespace

Resampler::Resampler(const Camera& target, const Camera& from, double max_shift) : from_(from.width, from.height) {
  if (!is_equal_within(target, from, max_shift)) map_ = remap_table(target, from);
}

std::vector<float> Resampler::depth(std::vector<float> image) const {
  if (is_identity()) return image;
  const cv::Mat1f from(from_.height, from_.width, image.data());
  std::vector<float> all(map_.total());
  std::transform(map_.begin(), map_.end(), all.begin(),
                 [&](const cv::Vec2f& place) { return depth_between(from, place[0], place[1]); });
  return all;
}

std::vector<std::uint32_t> Resampler::color(std::vector<std::uint32_t> image) const {
  if (is_identity()) return image;
  cv::Mat all(map_.size(), CV_8UC4);
  cv::remap(cv::Mat(from_, CV_8UC4, image.data()), all, map_, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  const auto* pixels = all.ptr<std::uint32_t>();
  return {pixels, pixels + all.total()};
}

std::vector<std::uint8_t> Resampler::confidence(std::vector<std::uint8_t> image) const {
  if (is_identity()) return image;
  std::vector<std::uint8_t> all(map_.total());
  std::transform(map_.begin(), map_.end(), all.begin(), [&](const cv::Vec2f& place) -> std::uint8_t {
    const int x = static_cast<int>(std::lround(place[0])), y = static_cast<int>(std::lround(place[1]));
    return x < 0 || y < 0 || x >= from_.width || y >= from_.height
               ? 0
               : image[static_cast<std::size_t>(y * from_.width + x)];
  });
  return all;
}

}  // namespace cairn
