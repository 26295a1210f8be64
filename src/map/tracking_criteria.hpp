// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// When the tracker trusts an alignment, and when it looks for another one.
#pragma once
#include <Eigen/Geometry>

#include "track/align.hpp"

namespace cairn {

// Of misfit: above the first another guess is tried, above the second the frame is not fused. Frames of hand-held
// Kinect recordings lie at 1.5 to 5; a pose 15 cm off gave 8.4.
constexpr double kDoubtful = 4.0, kMisfit = 7.0;
constexpr double kClearlyBetter = 0.8;       // times the cost of the guess from motion
constexpr double kDoubtfulBrightness = 0.1;  // photometric rmse, brightness in 0..1
constexpr double kSuddenly = 2.5;            // times the usual photometric rmse
constexpr double kTellsApart = 0.5;          // times the photometric rmse of another pose
constexpr double kUsualBrightness = 0.03;    // photometric rmse of hand-held Kinect recordings
// What a pose found after a loss must reach: a wrong one would be fused.
constexpr double kFoundInliers = 0.5, kFoundOverlap = 0.3, kFoundBrightness = 0.6, kFoundMisfit = 5.0;
// After so many lost frames, without brightness to tell, the camera may be anywhere: walls fit walls.
constexpr double kNearTurn = 0.02, kNearShift = 0.03;  // radians, metres
constexpr int kStillThere = 30;
constexpr double kKeyframeTurn = 0.2;       // radians
constexpr double kKeyframeDistance = 0.15;  // metres
constexpr double kKeyframeShare = 0.5;      // of the points in both images that fit

/// Mean squared residual of the points that see the model, in variances of the depth noise; outliers count as 9.
[[nodiscard]] double misfit(const Alignment& a);
/// Whether another guess should be tried. `usual_brightness`: photometric rmse of the frames before.
[[nodiscard]] bool is_doubtful(const Alignment& a, double usual_brightness);
/// Whether the frame fits clearly better at `a` than at `b`, by depth and by brightness.
[[nodiscard]] bool is_better(const Alignment& a, const Alignment& b);
/// Whether brightness tells that `a` is the pose of what stands still and `b` that of something that moves.
[[nodiscard]] bool tells_apart(const Alignment& a, const Alignment& b);
/// Whether a camera can have moved so within `seconds`.
[[nodiscard]] bool is_possible(const Eigen::Isometry3d& motion, double seconds, const MotionOptions& options);
/// How far a motion moves the view, about, as a share of the image's width.
[[nodiscard]] double view_change(const Camera& camera, const Eigen::Isometry3d& motion);
/// Whether an alignment, however small its overlap, found what a gyroscope said.
[[nodiscard]] bool is_near(const Alignment& a, const Eigen::Isometry3d& guess);
/// Whether a lost camera is found again.
[[nodiscard]] bool is_certain(const Alignment& a);
/// Whether a lost camera is found again where it was last, without having been recognised.
[[nodiscard]] bool is_certain_in_place(const Alignment& a, int lost_frames);
/// Whether brightness needs another reference than the one at `keyframe`. `a` is null for a frame without an alignment.
[[nodiscard]] bool is_new_reference(const Eigen::Isometry3d& keyframe, const Eigen::Isometry3d& camera,
                                    const Alignment* a);

}  // namespace cairn
