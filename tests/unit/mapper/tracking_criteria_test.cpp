// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/tracking_criteria.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace cairn {
namespace {

constexpr double kBelow = 0.999, kAbove = 1.001;  // times a threshold

/// Alignment that passes all criteria.
Alignment good() {
  return {.fit = {.inlier_share = 0.9, .overlap = 0.9, .rmse = 1, .photometric_share = 0.9, .photometric_rmse = 0.03}};
}

/// The same with another misfit: all points are inliers.
Alignment with_misfit(double misfit) {
  Alignment a = good();
  a.fit.inlier_share = 1;
  a.fit.rmse = std::sqrt(misfit);
  return a;
}

Eigen::Isometry3d moved(double distance, double angle) {
  Eigen::Isometry3d motion(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()));
  motion.translation().x() = distance;
  return motion;
}

TEST(TrackingCriteria, CountOutliersAsThreeDeviations) {
  Alignment a = good();
  a.fit.inlier_share = 0.5;
  a.fit.rmse = 2;
  EXPECT_DOUBLE_EQ(misfit(a), 0.5 * 4 + 0.5 * 9);
}

TEST(TrackingCriteria, RetryABadFit) {
  const auto with_brightness = [](double rmse) {
    Alignment a = good();
    a.fit.photometric_rmse = rmse;
    return a;
  };
  EXPECT_FALSE(is_doubtful(good(), {}));
  Alignment lost = good();
  lost.lost = FrameCause::out_of_view;
  EXPECT_TRUE(is_doubtful(lost, {}));
  EXPECT_FALSE(is_doubtful(with_misfit(kBelow * kRetryMisfit), {}));
  EXPECT_TRUE(is_doubtful(with_misfit(kAbove * kRetryMisfit), {}));
  EXPECT_FALSE(is_doubtful(with_brightness(kBelow * kRetryPhotometricRmse), {.photometric_rmse = 1}));
  EXPECT_TRUE(is_doubtful(with_brightness(kAbove * kRetryPhotometricRmse), {.photometric_rmse = 1}));
  EXPECT_FALSE(is_doubtful(with_brightness(kBelow * kRetryRmseRatio * 0.03), {}));
  EXPECT_TRUE(is_doubtful(with_brightness(kAbove * kRetryRmseRatio * 0.03), {}));
}

TEST(TrackingCriteria, NoisySensorIsNotRetriedIfBrightnessConfirms) {
  const TypicalFit noisy{.misfit = 5};
  EXPECT_FALSE(is_doubtful(with_misfit(kBelow * kRetryMisfitRatio * noisy.misfit), noisy));
  EXPECT_TRUE(is_doubtful(with_misfit(kAbove * kRetryMisfitRatio * noisy.misfit), noisy));
  Alignment without_color = with_misfit(kAbove * kRetryMisfit);
  without_color.fit.photometric_share = 0;
  EXPECT_TRUE(is_doubtful(without_color, noisy));
}

TEST(TrackingCriteria, BrightnessConfirmsAPoorFitOfDepth) {
  EXPECT_FALSE(is_poor(with_misfit(kAbove * kMaxMisfit), {}));
  EXPECT_TRUE(is_poor(with_misfit(kAbove * kMaxConfirmedMisfit), {}));
  Alignment dark = with_misfit(kAbove * kMaxMisfit);
  dark.fit.photometric_share = kBelow * kMinConfirmedShare;
  EXPECT_TRUE(is_poor(dark, {}));
  Alignment blurred = with_misfit(kAbove * kMaxMisfit);
  blurred.fit.photometric_rmse = kAbove * kRetryPhotometricRmse;
  EXPECT_TRUE(is_poor(blurred, {}));
}

TEST(TrackingCriteria, TypicalFitFollowsTheSensor) {
  TypicalFit typical;
  for (int i = 0; i < 100; ++i) typical.add(with_misfit(5));
  EXPECT_NEAR(typical.misfit, 5, 0.01);
  EXPECT_NEAR(typical.photometric_rmse, 0.03, 1e-6);
}

TEST(TrackingCriteria, PreferAClearlyBetterPose) {
  Alignment lost = good();
  lost.lost = FrameCause::too_few_inliers;
  EXPECT_TRUE(is_better(good(), lost));
  EXPECT_FALSE(is_better(lost, good()));
  // By depth alone.
  Alignment a = with_misfit(2), b = with_misfit(2);
  a.fit.photometric_share = b.fit.photometric_share = 0;
  a.fit.rmse = std::sqrt(kBelow * kMaxCostRatio * 2);
  EXPECT_TRUE(is_better(a, b));
  a.fit.rmse = std::sqrt(kAbove * kMaxCostRatio * 2);
  EXPECT_FALSE(is_better(a, b));
  // Equal depth, worse brightness: relative to the usual brightness error.
  a = b = with_misfit(1);
  a.fit.overlap = b.fit.overlap = 1;
  a.fit.photometric_rmse = kTypicalPhotometricRmse;
  b.fit.photometric_rmse = kTypicalPhotometricRmse * std::sqrt(2 / (kBelow * kMaxCostRatio) - 1);
  EXPECT_TRUE(is_better(a, b));
  b.fit.photometric_rmse = kTypicalPhotometricRmse * std::sqrt(2 / (kAbove * kMaxCostRatio) - 1);
  EXPECT_FALSE(is_better(a, b));
}

TEST(TrackingCriteria, IdentifyTheStaticPoseByBrightness) {
  Alignment still = good(), moving = good();
  moving.fit.photometric_rmse = 0.09;
  still.fit.photometric_rmse = kBelow * kStaticRmseRatio * 0.09;
  EXPECT_TRUE(is_static_pose(still, moving));
  still.fit.photometric_rmse = kAbove * kStaticRmseRatio * 0.09;
  EXPECT_TRUE(is_better(still, moving));
  EXPECT_FALSE(is_static_pose(still, moving));
}

TEST(TrackingCriteria, LimitTheSpeedOfHandsRobotsAndDrones) {
  constexpr double kSeconds = 1.0 / 30;
  for (const char* who : {"hand", "robot", "drone"}) {
    const MotionOptions limits = motion_of(who);
    const double step = static_cast<double>(limits.max_speed) * kSeconds,
                 turn = static_cast<double>(limits.max_turn) * kSeconds;
    EXPECT_TRUE(is_possible(moved(kBelow * step, 0), kSeconds, limits)) << who;
    EXPECT_FALSE(is_possible(moved(kAbove * step, 0), kSeconds, limits)) << who;
    EXPECT_TRUE(is_possible(moved(0, kBelow * turn), kSeconds, limits)) << who;
    EXPECT_FALSE(is_possible(moved(0, kAbove * turn), kSeconds, limits)) << who;
  }
  EXPECT_GT(motion_of("drone").max_speed, motion_of("hand").max_speed);
  EXPECT_THROW((void)motion_of("fish"), std::runtime_error);
}

TEST(TrackingCriteria, RelocalizeWithBrightnessAsGoodAsBefore) {
  const auto is_found = [](double rmse, double typical) {
    Alignment a = good();
    a.fit.photometric_rmse = rmse;
    return is_certain(a, {.photometric_rmse = typical});
  };
  EXPECT_FALSE(is_found(0.07, 0.01));  // another place of a flat at 4 Hz
  EXPECT_TRUE(is_found(kBelow * kAlwaysRelocalizedRmse, 0.001));
  EXPECT_TRUE(is_found(kBelow * kRetryPhotometricRmse, 1));
  EXPECT_FALSE(is_found(kAbove * kRetryPhotometricRmse, 1));
}

TEST(TrackingCriteria, RequireMoreAfterTrackingLoss) {
  EXPECT_TRUE(is_certain(good(), {}));
  const auto changed = [](double AlignmentFit::*what, double value) {
    Alignment a = good();
    a.fit.*what = value;
    return is_certain(a, {});
  };
  EXPECT_TRUE(changed(&AlignmentFit::inlier_share, kAbove * kMinRelocalizedInliers));
  EXPECT_FALSE(changed(&AlignmentFit::inlier_share, kBelow * kMinRelocalizedInliers));
  EXPECT_TRUE(changed(&AlignmentFit::overlap, kAbove * kMinRelocalizedOverlap));
  EXPECT_FALSE(changed(&AlignmentFit::overlap, kBelow * kMinRelocalizedOverlap));
  EXPECT_TRUE(changed(&AlignmentFit::photometric_share, kAbove * kMinRelocalizedPhotometricShare));
  EXPECT_FALSE(changed(&AlignmentFit::photometric_share, kBelow * kMinRelocalizedPhotometricShare));
  EXPECT_TRUE(changed(&AlignmentFit::photometric_share, 0));  // no color
  constexpr double kMaxRmse = kRetryRmseRatio * kTypicalPhotometricRmse;
  EXPECT_TRUE(changed(&AlignmentFit::photometric_rmse, kBelow * kMaxRmse));
  EXPECT_FALSE(changed(&AlignmentFit::photometric_rmse, kAbove * kMaxRmse));
  EXPECT_TRUE(is_certain(with_misfit(kBelow * kMaxRelocalizedMisfit), {}));
  EXPECT_FALSE(is_certain(with_misfit(kAbove * kMaxRelocalizedMisfit), {}));
  Alignment a = good();
  a.fit.unobserved = 1;
  EXPECT_FALSE(is_certain(a, {}));
}

TEST(TrackingCriteria, RejectWallsAloneAfterALongLoss) {
  Alignment by_depth = good();
  by_depth.fit.photometric_share = 0;
  EXPECT_TRUE(is_certain_in_place(by_depth, kMaxLostFramesInPlace, {}));
  EXPECT_FALSE(is_certain_in_place(by_depth, kMaxLostFramesInPlace + 1, {}));
  EXPECT_TRUE(is_certain_in_place(good(), 1000, {}));
}

TEST(TrackingCriteria, ReplaceADistantPhotometricReference) {
  const Eigen::Isometry3d here = Eigen::Isometry3d::Identity();
  const Alignment a = good();
  EXPECT_FALSE(is_new_reference(here, moved(kBelow * kMaxReferenceDistance, 0), &a));
  EXPECT_TRUE(is_new_reference(here, moved(kAbove * kMaxReferenceDistance, 0), &a));
  EXPECT_FALSE(is_new_reference(here, moved(0, kBelow * kMaxReferenceRotation), &a));
  EXPECT_TRUE(is_new_reference(here, moved(0, kAbove * kMaxReferenceRotation), &a));
  Alignment few = good();
  few.fit.photometric_share = kAbove * kMinReferenceShare;
  EXPECT_FALSE(is_new_reference(here, here, &few));
  few.fit.photometric_share = kBelow * kMinReferenceShare;
  EXPECT_TRUE(is_new_reference(here, here, &few));
  EXPECT_FALSE(is_new_reference(here, here, nullptr));
}

}  // namespace
}  // namespace cairn
