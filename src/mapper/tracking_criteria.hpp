// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Criteria to accept an alignment, or to try another guess.
#pragma once
#include <Eigen/Geometry>

#include "alignment/align.hpp"
#include "geometry/device_drift.hpp"

namespace cairn {

// Misfit above which another guess is tried, and above which the frame is not fused. Hand-held Kinect recordings have
// 1.5 to 5; a pose error of 15 cm gave 8.4.
constexpr double kRetryMisfit = 4.0, kMaxMisfit = 7.0;
constexpr double kMaxCostRatio = 0.8;          // times the cost of the guess from motion
constexpr double kRetryPhotometricRmse = 0.1;  // photometric rmse, brightness in 0..1
constexpr double kRetryRmseRatio = 2.5;        // times the mean photometric rmse
constexpr double kRetryMisfitRatio = 1.5;      // times the mean misfit, if brightness confirms the pose
constexpr double kNoisyMisfit = 3.5;           // min. mean misfit of a sensor with more noise than its model
constexpr double kStaticRmseRatio = 0.5;       // times the photometric rmse of another pose
// Of hand-held Kinect recordings.
constexpr double kTypicalPhotometricRmse = 0.03, kTypicalMisfit = 2.5;
// Minimum share of the points in the keyframe's image, and maximum misfit, for a pose confirmed by brightness: stereo
// depth has few agreeing normals.
constexpr double kMinConfirmedShare = 0.6, kMaxConfirmedMisfit = 8.0;
// Minimum requirements for a pose after tracking loss, since a wrong pose would be fused.
constexpr double kMinRelocalizedInliers = 0.5, kMinRelocalizedOverlap = 0.3, kMinRelocalizedPhotometricShare = 0.6,
                 kMaxRelocalizedMisfit = 5.0;
// Photometric rmse up to which no pose after a loss is rejected, however well the frames before fitted.
constexpr double kAlwaysRelocalizedRmse = 0.05;
constexpr double kMaxGyroRotationError = 0.02, kMaxGyroTranslationError = 0.03;  // rad, m
// Lost frames after which geometry alone does not confirm the last pose, since walls fit other walls.
constexpr int kMaxLostFramesInPlace = 30;
constexpr double kMaxReferenceRotation = 0.2;   // rad
constexpr double kMaxReferenceDistance = 0.15;  // m
constexpr double kMinReferenceShare = 0.5;      // min. share of the common points that fit
// Share of the image's width: view change from frame to frame from which features give the first guess.
constexpr double kWideViewChange = 0.2;
// Share of the image's width: max. view change to reuse a predicted surface.
constexpr double kMaxReuseViewChange = 0.03;
constexpr int kMaxPredictionFrames = 5;  // max. frames per predicted surface, since the map grows

/// Mean squared residual of the points that see the model, in variances of the depth noise; outliers count as 9.
[[nodiscard]] double misfit(const Alignment& a);
/// Running means over fused frames.
struct TypicalFit {
  double photometric_rmse = kTypicalPhotometricRmse, misfit = kTypicalMisfit;
  void add(const Alignment& a);
};
/// True if brightness fits as well as in the preceding frames.
[[nodiscard]] bool is_confirmed_by_brightness(const Alignment& a, const TypicalFit& typical);
/// Error of a pose from depth errors common to all pixels of a frame.
[[nodiscard]] PoseSigma common_error(const SensorModel& sensor, const std::vector<float>& depth);
/// True if another guess should be tried: a worse fit than the noise of the sensor explains.
[[nodiscard]] bool is_doubtful(const Alignment& a, const TypicalFit& typical);
/// True if the frame must not be fused.
[[nodiscard]] bool is_poor(const Alignment& a, const TypicalFit& typical);
/// True if the frame fits clearly better at `a` than at `b`, by depth and by brightness.
[[nodiscard]] bool is_better(const Alignment& a, const Alignment& b);
/// True if brightness identifies `a` as the pose of the static scene and `b` as the pose of a moving object.
[[nodiscard]] bool is_static_pose(const Alignment& a, const Alignment& b);
/// True if a camera can move this far within `seconds`.
[[nodiscard]] bool is_possible(const Eigen::Isometry3d& motion, double seconds, const MotionOptions& options);
/// Approximate view change of a motion, as a share of the image's width.
[[nodiscard]] double view_change(const Camera& camera, const Eigen::Isometry3d& motion);
/// True if a surface predicted for another pose, `motion` away, still covers the view after aligning `frames` frames.
[[nodiscard]] bool is_prediction_reusable(const Camera& camera, const Eigen::Isometry3d& motion, int frames);
/// True if an alignment, with any overlap, confirms the pose from the gyroscope, or a pose with larger errors (rad, m).
[[nodiscard]] bool is_near(const Alignment& a, const Eigen::Isometry3d& guess, double rotation = 0,
                           double translation = 0);
/// True if a lost camera is relocalized reliably.
[[nodiscard]] bool is_certain(const Alignment& a, const TypicalFit& typical);
/// True if a lost camera is found at its last pose reliably, without place recognition.
[[nodiscard]] bool is_certain_in_place(const Alignment& a, int lost_frames, const TypicalFit& typical);
/// True if the photometric term needs a new reference in place of `keyframe`. `a` is null for a frame without an
/// alignment.
[[nodiscard]] bool is_new_reference(const Eigen::Isometry3d& keyframe, const Eigen::Isometry3d& camera,
                                    const Alignment* a);

}  // namespace cairn
