// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/features.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace cairn {
namespace {

constexpr int kCorners = 800;
constexpr int kMaxHamming = 64;  // bits of 256 that two views of a corner may differ by
constexpr int kMinAgreeing = 20;
constexpr double kReprojection = 3.0;  // pixels
constexpr int kRansacIterations = 200;

cv::Mat grey(const std::vector<std::uint32_t>& colour, const Camera& camera) {
  const cv::Mat rgba(camera.height, camera.width, CV_8UC4, const_cast<std::uint32_t*>(colour.data()));
  cv::Mat out;
  cv::cvtColor(rgba, out, cv::COLOR_RGBA2GRAY);
  return out;
}

}  // namespace

Features describe(const std::vector<std::uint32_t>& colour, const std::vector<float>& depth, const Camera& camera) {
  std::vector<cv::KeyPoint> corners;
  cv::Mat descriptors;
  cv::ORB::create(kCorners)->detectAndCompute(grey(colour, camera), cv::noArray(), corners, descriptors);
  Features features;
  if (corners.empty()) return features;
  std::vector<cv::Point2d> pixels, rays;
  for (const auto& corner : corners) pixels.emplace_back(corner.pt.x, corner.pt.y);
  const cv::Matx33d k(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  cv::undistortPoints(pixels, rays, k, cv::Mat(1, 5, CV_64F, const_cast<double*>(camera.distortion.data())));
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const int x = std::clamp(static_cast<int>(std::lround(pixels[i].x)), 0, camera.width - 1);
    const int y = std::clamp(static_cast<int>(std::lround(pixels[i].y)), 0, camera.height - 1);
    const double z = depth[static_cast<std::size_t>(y * camera.width + x)];
    features.rays.emplace_back(rays[i].x, rays[i].y);
    features.points.emplace_back(z * rays[i].x, z * rays[i].y, z);
    std::memcpy(features.descriptors.emplace_back().data(), descriptors.ptr(static_cast<int>(i)), 32);
  }
  return features;
}

std::optional<Located> locate(const Features& known, const Features& seen, const Camera& camera) {
  if (known.descriptors.size() < kMinAgreeing || seen.descriptors.size() < kMinAgreeing) return std::nullopt;
  const auto mat = [](const Features& f) {
    return cv::Mat(static_cast<int>(f.descriptors.size()), 32, CV_8U,
                   const_cast<std::uint8_t*>(f.descriptors.front().data()));
  };
  std::vector<cv::DMatch> matches;
  cv::BFMatcher(cv::NORM_HAMMING, true).match(mat(seen), mat(known), matches);
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;
  for (const auto& m : matches) {
    const Eigen::Vector3d& p = known.points[static_cast<std::size_t>(m.trainIdx)];
    if (m.distance > kMaxHamming || p.z() <= 0) continue;
    const Eigen::Vector2d& r = seen.rays[static_cast<std::size_t>(m.queryIdx)];
    points.emplace_back(p.x(), p.y(), p.z());
    rays.emplace_back(r.x(), r.y());
  }
  if (points.size() < kMinAgreeing) return std::nullopt;
  cv::Vec3d turn, shift;
  std::vector<int> inliers;
  if (!cv::solvePnPRansac(points, rays, cv::Matx33d::eye(), cv::noArray(), turn, shift, false, kRansacIterations,
                          static_cast<float>(kReprojection / camera.fx), 0.995, inliers, cv::SOLVEPNP_EPNP) ||
      inliers.size() < kMinAgreeing)
    return std::nullopt;
  const Eigen::Vector3d axis(turn[0], turn[1], turn[2]);
  Eigen::Isometry3d seen_from_known = Eigen::Isometry3d::Identity();
  if (axis.norm() > 0) seen_from_known.linear() = Eigen::AngleAxisd(axis.norm(), axis.normalized()).toRotationMatrix();
  seen_from_known.translation() = Eigen::Vector3d(shift[0], shift[1], shift[2]);
  if (!seen_from_known.matrix().allFinite()) return std::nullopt;
  return Located{.known_from_seen = seen_from_known.inverse(), .inliers = static_cast<int>(inliers.size())};
}

Thumbnail thumbnail(const std::vector<std::uint32_t>& colour, const std::vector<float>& depth, const Camera& camera) {
  cv::Mat image;
  if (colour.empty())
    image = cv::Mat(camera.height, camera.width, CV_32F, const_cast<float*>(depth.data()));
  else
    grey(colour, camera).convertTo(image, CV_32F);
  cv::Mat small;
  cv::resize(image, small, {40, 30}, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(small, small, {}, 1.0);
  Thumbnail t;
  std::copy_n(small.ptr<float>(), t.size(), t.begin());
  const float mean = std::accumulate(t.begin(), t.end(), 0.0f) / static_cast<float>(t.size());
  float norm = 0;
  for (float& v : t) v -= mean, norm += v * v;
  for (float& v : t) v /= std::sqrt(std::max(norm, 1e-12f));
  return t;
}

float similarity(const Thumbnail& a, const Thumbnail& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0f);
}

}  // namespace cairn
