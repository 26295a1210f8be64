// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/focal.hpp"

#include <opencv2/calib3d.hpp>

#include "place/matches.hpp"

namespace cairn {
namespace {

constexpr std::size_t kMinMatches = 40, kMinInliers = 8;
constexpr double kReprojection = 2.0;  // pixels
constexpr int kRansacIterations = 100;

/// Matches with a reprojection error of less than `error`.
Matches near(const Matches& matches, const cv::Vec3d& rotation, const cv::Vec3d& translation, double error) {
  std::vector<cv::Point2d> projected;
  cv::projectPoints(matches.points, rotation, translation, cv::Matx33d::eye(), cv::noArray(), projected);
  Matches inlier_matches;
  for (std::size_t i = 0; i < projected.size(); ++i) {
    if (!(cv::norm(projected[i] - matches.rays[i]) < error)) continue;
    inlier_matches.points.push_back(matches.points[i]);
    inlier_matches.rays.push_back(matches.rays[i]);
  }
  return inlier_matches;
}

/// Estimates a pose from a few matches, then from all inliers (as Chum, Matas & Kittler 2003 in a RANSAC loop): depth
/// is noisy, and with the first pose alone the inliers would not show the better focal length.
int inliers_of(Matches matches, double focal, double scale) {
  for (auto& p : matches.points) p.x /= scale, p.y /= scale;
  for (auto& r : matches.rays) r *= 1 / scale;
  cv::Vec3d rotation, translation;
  std::vector<int> inliers;
  const double error = kReprojection / (focal * scale);
  if (!cv::solvePnPRansac(matches.points, matches.rays, cv::Matx33d::eye(), cv::noArray(), rotation, translation, false,
                          kRansacIterations, static_cast<float>(2 * error), 0.99, inliers, cv::SOLVEPNP_EPNP))
    return 0;
  for (const double factor : {3.0, 1.5}) {
    const Matches inlier_matches = near(matches, rotation, translation, factor * error);
    if (inlier_matches.points.size() < kMinInliers ||
        !cv::solvePnP(inlier_matches.points, inlier_matches.rays, cv::Matx33d::eye(), cv::noArray(), rotation,
                      translation, true))
      return 0;
  }
  return static_cast<int>(near(matches, rotation, translation, error).points.size());
}

}  // namespace

std::optional<std::array<int, kWideFocalScales.size()>> focal_inliers(const Features& known, const Features& seen,
                                                                      const Camera& camera) {
  const Matches matches = match(known, seen);
  if (matches.points.size() < kMinMatches) return std::nullopt;
  std::array<int, kWideFocalScales.size()> inliers{};
  for (std::size_t i = 0; i < inliers.size(); ++i) inliers[i] = inliers_of(matches, camera.fx, kWideFocalScales[i]);
  return inliers;
}

}  // namespace cairn
