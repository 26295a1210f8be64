// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/tracking_criteria.hpp"

#include <algorithm>

#include "preprocess/rectify.hpp"

namespace cairn {
namespace {

constexpr double kTypicalDepth = 1.5;  // m

double angle_of(const Eigen::Isometry3d& motion) { return Eigen::AngleAxisd(motion.linear()).angle(); }

}  // namespace

double misfit(const Alignment& a) {
  return a.fit.inlier_share * a.fit.rmse * a.fit.rmse + (1 - a.fit.inlier_share) * 9;
}

void TypicalFit::add(const Alignment& a) {
  misfit += 0.1 * (cairn::misfit(a) - misfit);
  if (a.fit.photometric_share > 0) photometric_rmse += 0.1 * (a.fit.photometric_rmse - photometric_rmse);
}

PoseSigma common_error(const SensorModel& sensor, const std::vector<float>& depth) {
  const float typical = median_depth(depth);
  const double error = static_cast<double>(sensor.common_error * sensor.sigma(typical));
  return {.rotation = error / static_cast<double>(typical), .translation = error};
}

namespace {

/// True if brightness fits clearly worse than in the preceding frames.
bool is_contradicted_by_brightness(const Alignment& a, const TypicalFit& typical) {
  return a.fit.photometric_rmse > std::min(kRetryPhotometricRmse, kRetryRmseRatio * typical.photometric_rmse);
}

}  // namespace

bool is_confirmed_by_brightness(const Alignment& a, const TypicalFit& typical) {
  return a.fit.photometric_share > kMinConfirmedShare && !is_contradicted_by_brightness(a, typical);
}

bool is_doubtful(const Alignment& a, const TypicalFit& typical) {
  const bool is_confirmed = is_confirmed_by_brightness(a, typical);
  const bool is_noisy = typical.misfit > kNoisyMisfit;
  const double max_misfit = is_confirmed && is_noisy ? kRetryMisfitRatio * typical.misfit : kRetryMisfit;
  return !a.converged() || misfit(a) > max_misfit || is_contradicted_by_brightness(a, typical);
}

bool is_poor(const Alignment& a, const TypicalFit& typical) {
  return misfit(a) > (is_confirmed_by_brightness(a, typical) ? kMaxConfirmedMisfit : kMaxMisfit);
}

bool is_better(const Alignment& a, const Alignment& b) {
  if (!a.converged() || !b.converged()) return a.converged();
  const bool compares_brightness = a.fit.photometric_share > 0 && b.fit.photometric_share > 0;
  const auto cost = [&](const Alignment& x) {
    const double brightness = compares_brightness ? x.fit.photometric_rmse / kTypicalPhotometricRmse : 0.0;
    return misfit(x) / x.fit.overlap + brightness * brightness;
  };
  return cost(a) < kMaxCostRatio * cost(b);
}

bool is_static_pose(const Alignment& a, const Alignment& b) {
  return is_better(a, b) && a.fit.photometric_rmse < kStaticRmseRatio * b.fit.photometric_rmse;
}

bool is_possible(const Eigen::Isometry3d& motion, double seconds, const MotionOptions& options) {
  return motion.translation().norm() <= static_cast<double>(options.max_speed) * seconds &&
         angle_of(motion) <= static_cast<double>(options.max_turn) * seconds;
}

double view_change(const Camera& camera, const Eigen::Isometry3d& motion) {
  return camera.fx * (angle_of(motion) + motion.translation().norm() / kTypicalDepth) / camera.width;
}

bool is_prediction_reusable(const Camera& camera, const Eigen::Isometry3d& motion, int frames) {
  return frames < kMaxPredictionFrames && view_change(camera, motion) < kMaxReuseViewChange;
}

bool is_near(const Alignment& a, const Eigen::Isometry3d& guess, double rotation, double translation) {
  const Eigen::Isometry3d motion = guess.inverse() * a.submap_from_camera;
  return a.fit.inlier_share > kMinRelocalizedInliers && misfit(a) < kMaxRelocalizedMisfit &&
         angle_of(motion) < std::max(kMaxGyroRotationError, rotation) &&
         motion.translation().norm() < std::max(kMaxGyroTranslationError, translation);
}

bool is_certain(const Alignment& a, const TypicalFit& typical) {
  const double max_rmse =
      std::clamp(kRetryRmseRatio * typical.photometric_rmse, kAlwaysRelocalizedRmse, kRetryPhotometricRmse);
  return a.converged() && a.fit.inlier_share > kMinRelocalizedInliers && a.fit.overlap > kMinRelocalizedOverlap &&
         misfit(a) < kMaxRelocalizedMisfit && a.fit.unobserved == 0 &&
         (a.fit.photometric_share == 0 ||
          (a.fit.photometric_share > kMinRelocalizedPhotometricShare && a.fit.photometric_rmse < max_rmse));
}

bool is_certain_in_place(const Alignment& a, int lost_frames, const TypicalFit& typical) {
  return is_certain(a, typical) && (lost_frames <= kMaxLostFramesInPlace || a.fit.photometric_share > 0);
}

bool is_new_reference(const Eigen::Isometry3d& keyframe, const Eigen::Isometry3d& camera, const Alignment* a) {
  const Eigen::Isometry3d motion = keyframe.inverse() * camera;
  return motion.translation().norm() > kMaxReferenceDistance || angle_of(motion) > kMaxReferenceRotation ||
         (a != nullptr && a->fit.photometric_share < kMinReferenceShare);
}

}  // namespace cairn
