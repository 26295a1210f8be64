// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/colour_registration.hpp"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <stdexcept>

namespace cairn {
namespace {

constexpr float kUnknownDepth = 2.0f;  // metres, where depth is missing: nothing there is fused, but edges should not
                                       // appear around it

cv::Matx33d matrix(const Camera& c) { return {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1}; }
cv::Mat distortion(const Camera& c) { return cv::Mat(c.distortion, true); }

}  // namespace

ColourRegistration::ColourRegistration(const Camera& depth, const ColourCamera& colour) : colour_(colour) {
  std::vector<cv::Point2d> pixels;
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) pixels.emplace_back(x, y);
  cv::undistortPoints(pixels, rays_, matrix(depth), distortion(depth));
}

std::vector<std::uint32_t> ColourRegistration::operator()(std::span<const float> depth,
                                                          std::span<const std::uint32_t> image) const {
  const Camera& c = colour_.camera;
  if (depth.size() != rays_.size() ||
      image.size() != static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height))
    throw std::runtime_error("camera.yaml: the images are not of the sizes it tells");
  std::vector<cv::Point3d> points(depth.size());
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const double z = depth[i] > 0 ? depth[i] : kUnknownDepth;
    points[i] = {rays_[i].x * z, rays_[i].y * z, z};
  }
  cv::Matx33d rotation;
  cv::Vec3d rotation_vector;
  cv::eigen2cv(Eigen::Matrix3d(colour_.colour_from_depth.linear()), rotation);
  cv::Rodrigues(rotation, rotation_vector);
  const Eigen::Vector3d& t = colour_.colour_from_depth.translation();
  std::vector<cv::Point2d> seen;
  cv::projectPoints(points, rotation_vector, cv::Vec3d(t.x(), t.y(), t.z()), matrix(c), distortion(c), seen);
  std::vector<std::uint32_t> colour(depth.size(), 0);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const auto x = static_cast<int>(std::lround(seen[i].x)), y = static_cast<int>(std::lround(seen[i].y));
    if (x >= 0 && x < c.width && y >= 0 && y < c.height) colour[i] = image[static_cast<std::size_t>(y * c.width + x)];
  }
  return colour;
}

}  // namespace cairn
