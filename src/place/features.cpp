// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/features.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "place/matches.hpp"

namespace cairn {
namespace {

constexpr int kMaxFeatures = 800;
constexpr int kMinInliers = 20;
constexpr double kMaxReprojectionError = 3.0;  // pixels
constexpr int kRansacIterations = 200;

cv::Mat gray(const std::vector<std::uint32_t>& color, const Camera& camera) {
  const cv::Mat rgba(camera.height, camera.width, CV_8UC4, const_cast<std::uint32_t*>(color.data()));
  cv::Mat out;
  cv::cvtColor(rgba, out, cv::COLOR_RGBA2GRAY);
  return out;
}

/// Synthetic image of a surface without color, lit from the upper left: edges and steps of the geometry, smoothed over
/// the depth noise.
cv::Mat shaded(const std::vector<float>& depth, const Camera& camera) {
  constexpr int kSlopeRange = 4;     // pixels to each side for the slope
  constexpr float kBlur = 3.0f;      // pixels
  constexpr float kMaxSlope = 3.0f;  // m/m
  const cv::Mat z(camera.height, camera.width, CV_32F, const_cast<float*>(depth.data()));
  cv::Mat known, smooth, share;
  cv::Mat(z > 0).convertTo(known, CV_32F, 1.0 / 255);
  cv::GaussianBlur(z, smooth, {}, kBlur);
  cv::GaussianBlur(known, share, {}, kBlur);
  smooth /= cv::max(share, 1e-3f);
  cv::Mat out(camera.height, camera.width, CV_8U, cv::Scalar(0));
  for (int y = kSlopeRange; y + kSlopeRange < camera.height; ++y)
    for (int x = kSlopeRange; x + kSlopeRange < camera.width; ++x) {
      const float at = smooth.at<float>(y, x);
      if (share.at<float>(y, x) < 0.5f) continue;
      const float meters = 2 * kSlopeRange * at / static_cast<float>(camera.fx);
      const auto slope = [&](float step) { return std::clamp(step / meters, -kMaxSlope, kMaxSlope); };
      const float dx = slope(smooth.at<float>(y, x + kSlopeRange) - smooth.at<float>(y, x - kSlopeRange));
      const float dy = slope(smooth.at<float>(y + kSlopeRange, x) - smooth.at<float>(y - kSlopeRange, x));
      const float light = (0.5f * dx + 0.7f * dy + 0.5f) / std::sqrt(dx * dx + dy * dy + 1);
      out.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(128 + 110 * light);
    }
  return out;
}

struct Pnp {
  cv::Vec3d rotation, translation;  // seen_from_known
  std::vector<int> inliers;
};
std::optional<Pnp> solve(const Matches& matches, const Camera& camera) {
  if (matches.points.size() < kMinInliers) return std::nullopt;
  Pnp pnp;
  if (!cv::solvePnPRansac(matches.points, matches.rays, cv::Matx33d::eye(), cv::noArray(), pnp.rotation,
                          pnp.translation, false, kRansacIterations,
                          static_cast<float>(kMaxReprojectionError / camera.fx), 0.995, pnp.inliers,
                          cv::SOLVEPNP_EPNP) ||
      pnp.inliers.size() < kMinInliers)
    return std::nullopt;
  return pnp;
}

}  // namespace

Features extract_features(const std::vector<std::uint32_t>& color, const std::vector<float>& depth,
                          const Camera& camera) {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  cv::ORB::create(kMaxFeatures)
      ->detectAndCompute(color.empty() ? shaded(depth, camera) : gray(color, camera), cv::noArray(), keypoints,
                         descriptors);
  Features features;
  if (keypoints.empty()) return features;
  std::vector<cv::Point2d> pixels, rays;
  for (const auto& keypoint : keypoints) pixels.emplace_back(keypoint.pt.x, keypoint.pt.y);
  const cv::Matx33d k(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  if (camera.lens == Lens::brown_conrady)
    cv::undistortPoints(pixels, rays, k, cv::Mat(1, 8, CV_64F, const_cast<double*>(camera.distortion.data())));
  else
    for (const auto& p : pixels) {
      const Eigen::Vector2d ray = camera.undistorted_ray(p.x, p.y);
      rays.emplace_back(ray.x(), ray.y());
    }
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const int x = std::clamp(static_cast<int>(std::lround(pixels[i].x)), 0, camera.width - 1);
    const int y = std::clamp(static_cast<int>(std::lround(pixels[i].y)), 0, camera.height - 1);
    const double z = depth[static_cast<std::size_t>(y * camera.width + x)];
    features.rays.emplace_back(rays[i].x, rays[i].y);
    features.points.emplace_back(z * rays[i].x, z * rays[i].y, z);
    std::memcpy(features.descriptors.emplace_back().data(), descriptors.ptr(static_cast<int>(i)), 32);
  }
  return features;
}

std::optional<PnpPose> solve_pnp(const Features& known, const Features& seen, const Camera& camera) {
  const auto pnp = solve(match(known, seen), camera);
  if (!pnp) return std::nullopt;
  const Eigen::Vector3d axis(pnp->rotation[0], pnp->rotation[1], pnp->rotation[2]);
  Eigen::Isometry3d seen_from_known = Eigen::Isometry3d::Identity();
  if (axis.norm() > 0) seen_from_known.linear() = Eigen::AngleAxisd(axis.norm(), axis.normalized()).toRotationMatrix();
  seen_from_known.translation() = Eigen::Vector3d(pnp->translation[0], pnp->translation[1], pnp->translation[2]);
  if (!seen_from_known.matrix().allFinite()) return std::nullopt;
  return PnpPose{.known_from_seen = seen_from_known.inverse(), .inliers = static_cast<int>(pnp->inliers.size())};
}

std::vector<double> focal_costs(const Features& known, const Features& seen, const Camera& camera) {
  const Matches matches = match(known, seen);
  const auto pnp = solve(matches, camera);
  if (!pnp) return {};
  // Includes matches rejected by the first pose because of a wrong focal length.
  std::vector<cv::Point2d> projected;
  const auto project = [&](const std::vector<cv::Point3d>& points, const cv::Vec3d& rotation,
                           const cv::Vec3d& translation) {
    cv::projectPoints(points, rotation, translation, cv::Matx33d::eye(), cv::noArray(), projected);
  };
  project(matches.points, pnp->rotation, pnp->translation);
  Matches near;
  for (std::size_t i = 0; i < projected.size(); ++i) {
    if (!(cv::norm(projected[i] - matches.rays[i]) * camera.fx < 3 * kMaxReprojectionError)) continue;
    near.points.push_back(matches.points[i]);
    near.rays.push_back(matches.rays[i]);
  }
  std::vector<double> costs;
  for (const double scale : kFocalScales) {
    Matches scaled = near;
    for (auto& p : scaled.points) p.x /= scale, p.y /= scale;
    for (auto& r : scaled.rays) r *= 1 / scale;
    cv::Vec3d rotation = pnp->rotation, translation = pnp->translation;
    if (!cv::solvePnP(scaled.points, scaled.rays, cv::Matx33d::eye(), cv::noArray(), rotation, translation, true))
      return {};
    project(scaled.points, rotation, translation);
    double squared = 0;
    for (std::size_t i = 0; i < projected.size(); ++i) {
      const double error = cv::norm(projected[i] - scaled.rays[i]) * camera.fx * scale;
      squared += std::min(error * error, kMaxReprojectionError * kMaxReprojectionError);
    }
    costs.push_back(squared / static_cast<double>(projected.size()));
  }
  return costs;
}

}  // namespace cairn
