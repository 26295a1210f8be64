// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/tracking_criteria.hpp"

namespace cairn {
namespace {

constexpr double kUsualDepth = 1.5;  // m

double angle_of(const Eigen::Isometry3d& motion) { return Eigen::AngleAxisd(motion.linear()).angle(); }

}  // namespace

double misfit(const Alignment& a) {
  return a.fit.inlier_share * a.fit.rmse * a.fit.rmse + (1 - a.fit.inlier_share) * 9;
}

bool is_doubtful(const Alignment& a, double usual_brightness) {
  return !a.converged() || misfit(a) > kDoubtful || a.fit.photometric_rmse > kDoubtfulBrightness ||
         a.fit.photometric_rmse > kSuddenly * usual_brightness;
}

bool is_better(const Alignment& a, const Alignment& b) {
  if (!a.converged() || !b.converged()) return a.converged();
  const bool compares_brightness = a.fit.photometric_share > 0 && b.fit.photometric_share > 0;
  const auto cost = [&](const Alignment& x) {
    const double brightness = compares_brightness ? x.fit.photometric_rmse / kUsualBrightness : 0.0;
    return misfit(x) / x.fit.overlap + brightness * brightness;
  };
  return cost(a) < kClearlyBetter * cost(b);
}

bool tells_apart(const Alignment& a, const Alignment& b) {
  return is_better(a, b) && a.fit.photometric_rmse < kTellsApart * b.fit.photometric_rmse;
}

bool is_possible(const Eigen::Isometry3d& motion, double seconds, const MotionOptions& options) {
  return motion.translation().norm() <= static_cast<double>(options.max_speed) * seconds &&
         angle_of(motion) <= static_cast<double>(options.max_turn) * seconds;
}

double view_change(const Camera& camera, const Eigen::Isometry3d& motion) {
  return camera.fx * (angle_of(motion) + motion.translation().norm() / kUsualDepth) / camera.width;
}

bool is_near(const Alignment& a, const Eigen::Isometry3d& guess) {
  const Eigen::Isometry3d motion = guess.inverse() * a.submap_from_camera;
  return a.fit.inlier_share > kFoundInliers && misfit(a) < kFoundMisfit && angle_of(motion) < kNearTurn &&
         motion.translation().norm() < kNearShift;
}

bool is_certain(const Alignment& a) {
  return a.converged() && a.fit.inlier_share > kFoundInliers && a.fit.overlap > kFoundOverlap &&
         misfit(a) < kFoundMisfit && a.fit.unobserved == 0 &&
         (a.fit.photometric_share == 0 ||
          (a.fit.photometric_share > kFoundBrightness && a.fit.photometric_rmse < kDoubtfulBrightness));
}

bool is_certain_in_place(const Alignment& a, int lost_frames) {
  return is_certain(a) && (lost_frames <= kStillThere || a.fit.photometric_share > 0);
}

bool is_new_reference(const Eigen::Isometry3d& keyframe, const Eigen::Isometry3d& camera, const Alignment* a) {
  const Eigen::Isometry3d motion = keyframe.inverse() * camera;
  return motion.translation().norm() > kKeyframeDistance || angle_of(motion) > kKeyframeTurn ||
         (a != nullptr && a->fit.photometric_share < kKeyframeShare);
}

}  // namespace cairn
