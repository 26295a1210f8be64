// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a Mapper tells about frames, loops and itself.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/camera.hpp"
#include "cairn/depth_correction.hpp"
#include "cairn/pose.hpp"

namespace cairn {

/// What became of a frame.
enum class FrameState {
  fused,    ///< has a pose and is part of the map
  lost,     ///< no trustworthy pose: not fused
  skipped,  ///< could not be used at all
  held_out  ///< has a pose and is no part of the map: Frame::held_out
};

/// `fused`, `lost`, `skipped` or `held_out`.
[[nodiscard]] std::string_view name_of(FrameState state);

/// Why a frame is not part of the map, or is so in another way than usual.
enum class FrameCause {
  none,
  // skipped
  unreadable,      ///< Frame::problem
  wrong_size,      ///< the depth image is not of the camera's size
  bad_depth,       ///< negative, or no number
  constant_depth,  ///< every depth is the same
  bad_timestamp,   ///< no number
  timestamp_goes_back,
  stuck,             ///< the depth image repeats
  too_little_depth,  ///< to begin the map with
  no_pose,           ///< Poses::given, and none for this time
  bad_pose,          ///< Poses::given: no rotation and translation
  far_pose,          ///< Poses::given: too far from the origin for single precision
  // lost
  little_depth,     ///< for an alignment
  out_of_view,      ///< too little of the frame sees the map
  too_few_inliers,  ///< TrackOptions::min_inlier_share
  large_residuals,  ///< TrackOptions::max_rmse
  too_fast,         ///< no hand moves like that
  poor_fit,         ///< the frame fits the map badly from every guess
  not_relocalised,  ///< not found again yet
  // fused
  new_component,  ///< not found again: begins a part of the map of its own
  partly_used     ///< without its colour image or acceleration
};

/// A cause in words, as FrameReport::reason begins.
[[nodiscard]] std::string_view text_of(FrameCause cause);

/// How well a frame's surface fits the map where it was aligned.
struct AlignmentFit {
  double inlier_share = 0.0;       ///< of the points that see the map, those that fit
  double overlap = 0.0;            ///< share of the frame's points that see the map
  double rmse = 0.0;               ///< of the inliers, standard deviations of the depth noise
  double photometric_share = 0.0;  ///< of the points with brightness in both images; 0: no colour was used
  double photometric_rmse = 0.0;   ///< brightness in 0..1
  int degenerate_directions = 0;   ///< of the pose, of 6, that the surface does not determine
  int unobserved = 0;              ///< directions, of 6, that were left as the motion before says
  int iterations = 0;              ///< over all levels
};

/// What became of one frame, and how well it fits the map.
struct FrameReport {
  int index = 0;                           ///< Frame::index
  double timestamp = 0.0;                  ///< seconds
  FrameState state = FrameState::skipped;  ///< what became of it
  FrameCause cause = FrameCause::none;     ///< why
  std::string reason;                      ///< the same in words, with what was found
  AlignmentFit fit;                        ///< all 0 where nothing was aligned
  /// Where the depth camera was, of a frame that was fused or held out: in the frame in which the camera is tracked,
  /// which is the world's before loops correct the map and before it is turned upright; with Poses::given the pose that
  /// was given.
  std::optional<Eigen::Isometry3d> tracked_from_camera;
  /// How sure that pose is beside the map: of (rotation, translation) in the camera's frame, rad^2 and m^2, by the last
  /// iteration's normal equations, scaled by its residuals, as the pose graph believes it. It says nothing of how far
  /// the map itself has drifted. What neither surface nor brightness determines has a deviation of about 1 rad or 1 m;
  /// but without colour the noise of normals passes for structure as long as the map is young (a bare wall is then
  /// sure to some millimetres along itself, and should not be). None where nothing was aligned: the first frame of a
  /// map or of a component, and given poses.
  std::optional<Matrix6d> covariance;
  double moving = 0.0;                     ///< share of the image that was left out since it moves
  std::string guess;                       ///< where the alignment started: motion, still, features, relocalised
  int touched_bricks = 0;                  ///< that were fused into
  int new_bricks = 0;                      ///< of these
  std::map<std::string, double> stage_ms;  ///< preprocess, raycast, track, fuse, keyframe, esdf, esdf to host
};

/// What Mapper::refine did.
struct Refined {
  int keyframes = 0;
  int pairs_tried = 0;     ///< of keyframes that see the same
  int pairs_aligned = 0;   ///< of these
  int pairs_inlier = 0;    ///< of these, those that the pose graph keeps
  double cost_before = 0;  ///< half the sum of squared errors of the pose graph in units of their noise
  double cost = 0;         ///< the same afterwards
};

/// What Mapper::adjust did.
struct Adjusted {
  int keyframes = 0;           ///< that were moved
  int surfels = 0;             ///< the surface that they see
  int observations = 0;        ///< of it
  double clock_offset = 0;     ///< seconds that the colour camera's clock is ahead of the depth camera's
  double readout = 0;          ///< seconds from the first row to the last, beside what the rig says of its shutters
  double readout_sigma = 0;    ///< standard deviation of that
  double predicts_better = 0;  ///< share of what surfels that were held out are off, that the readout takes away
  bool has_readout = false;    ///< that confirms it
  /// What the depth camera errs by, beside what the rig says of it; empty where held-out surfels do not confirm it.
  DepthCorrection correction;
  double corrected_predicts_better = 0;  ///< the same share, that the correction takes away
  /// How surely each keyframe that was moved lies where it is, seen from the first: of `pose * retract(error)`,
  /// radians, then metres. Empty where nothing was adjusted.
  struct KeyframeCovariance {
    double timestamp = 0;  ///< seconds
    Matrix6d covariance = Matrix6d::Zero();
  };
  std::vector<KeyframeCovariance> covariances;
};

/// Two keyframes that were recognised as views of the same place.
struct FoundLoop {
  double from = 0;                                             ///< timestamp of keyframe i, seconds
  double to = 0;                                               ///< timestamp of keyframe j, seconds
  Eigen::Isometry3d i_from_j = Eigen::Isometry3d::Identity();  ///< measured
  int corners = 0;                                             ///< that agreed
  double inlier_share = 0;                                     ///< of the dense alignment, as in FrameReport
  double rmse = 0;                                             ///< of the dense alignment, as in FrameReport
  bool inlier = true;                                          ///< the pose graph keeps it
};

/// How large a map is, what it cost, and what was learned of the camera.
struct Statistics {
  std::string device;                          ///< its name
  std::uint64_t device_memory_peak = 0;        ///< bytes
  std::uint64_t device_waits = 0;              ///< of the host for the device
  std::uint64_t uploaded = 0, downloaded = 0;  ///< bytes to the device, and back
  std::uint64_t bricks = 0;                    ///< of 8x8x8 voxels, that were allocated
  std::uint64_t paged_out = 0, paged_in = 0;   ///< bricks that went to the host, and back
  int keyframes = 0;
  int submaps = 0;                                        ///< that ended
  int components = 0;                                     ///< parts of the map that nothing joins
  int looked_up = 0;                                      ///< keyframes looked for among earlier ones
  int loops_tried = 0;                                    ///< pairs that were aligned
  double graph_ms = 0;                                    ///< the longest optimisation
  double world_ms = 0;                                    ///< the longest update of the world's volume
  std::uint64_t submap_memory_peak = 0;                   ///< bytes on the host
  std::uint64_t submaps_read_back = 0;                    ///< from the disk
  double clock_offset = 0;                                ///< seconds that the colour camera's clock is ahead
  FocalEvidence focal;                                    ///< whether the images fit another focal length better
  std::map<std::string, std::pair<int, double>> kernels;  ///< calls and total milliseconds on the device, by kernel
  /// Of an adjusted map's surface, metres: the median, and what 95 % lie below, see SurfaceSigma. 0: not known.
  float sigma_median = 0, sigma_95 = 0;
};

}  // namespace cairn
