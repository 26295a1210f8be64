// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reports of a Mapper about frames, loop closures and itself.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/mapping/camera.hpp"
#include "cairn/mapping/depth_correction.hpp"
#include "cairn/mapping/pose.hpp"

namespace cairn {

/// Outcome of a frame.
enum class FrameState {
  fused,    ///< has a pose and was integrated into the map
  lost,     ///< no reliable pose: not integrated
  skipped,  ///< unusable frame
  held_out  ///< has a pose, not integrated: Frame::held_out
};

/// `fused`, `lost`, `skipped` or `held_out`.
[[nodiscard]] std::string_view to_string(FrameState state);

/// Reason for a frame that was not integrated, or only partly.
enum class FrameCause {
  none,
  // skipped
  unreadable,      ///< Frame::problem
  wrong_size,      ///< depth image size differs from the camera's
  bad_depth,       ///< negative, or not a number
  constant_depth,  ///< every depth is the same
  bad_timestamp,   ///< not a number
  timestamp_goes_back,
  stuck,             ///< repeated depth image
  too_little_depth,  ///< too few measurements to initialize the map
  no_pose,           ///< Poses::given, without a pose for this time
  bad_pose,          ///< Poses::given: not a rigid transform
  far_pose,          ///< Poses::given: too far from the origin for single precision
  // lost
  little_depth,     ///< too few measurements for an alignment
  out_of_view,      ///< too little overlap with the map
  too_few_inliers,  ///< TrackOptions::min_inlier_share
  large_residuals,  ///< TrackOptions::max_rmse
  too_fast,         ///< exceeds the speed limits
  poor_fit,         ///< bad fit to the map from every initial guess
  not_relocalized,  ///< not relocalized yet
  // fused
  new_component,  ///< not relocalized: starts a new component
  partly_used     ///< without its color image or acceleration
};

/// Text of a cause, the start of FrameReport::reason.
[[nodiscard]] std::string_view to_string(FrameCause cause);

/// Initial guess of a frame's alignment with the map.
enum class InitialGuess {
  none,         ///< no alignment
  motion,       ///< predicted from the previous frames, the gyroscope or Frame::guess
  still,        ///< pose of the previous frame
  features,     ///< features of recent keyframes
  relocalized,  ///< features of any keyframe, after a loss
  gyroscope,    ///< the gyroscope's prediction replaces the alignment
  device        ///< the device's own pose replaces the alignment
};

/// Name of the enumerator; empty for `none`.
[[nodiscard]] std::string_view to_string(InitialGuess guess);

/// Quality of a frame's alignment with the map.
struct AlignmentFit {
  double inlier_share = 0.0;       ///< inliers among the points that see the map
  double overlap = 0.0;            ///< fraction of the frame's points that see the map
  double rmse = 0.0;               ///< of the inliers, in standard deviations of the depth noise
  double photometric_share = 0.0;  ///< fraction of points with brightness in both images; 0: no color used
  double photometric_rmse = 0.0;   ///< brightness in 0..1
  int degenerate_directions = 0;   ///< directions of the pose, of 6, not determined by the surface
  int unobserved = 0;              ///< directions, of 6, set by the motion prediction
  int iterations = 0;              ///< over all levels
};

/// Result of one frame: outcome, pose and quality.
struct FrameReport {
  int index = 0;                           ///< Frame::index
  double timestamp = 0.0;                  ///< seconds
  FrameState state = FrameState::skipped;  ///< outcome of the frame
  FrameCause cause = FrameCause::none;     ///< reason for the outcome
  std::string reason;                      ///< text of the cause, with the measured value
  AlignmentFit fit;                        ///< all 0 without an alignment
  /// Pose of the depth camera for a fused or held-out frame, in the tracking frame (the world frame before loop
  /// corrections and gravity alignment); with Poses::given the given pose.
  std::optional<Eigen::Isometry3d> tracked_from_camera;
  /// Covariance of this pose relative to the map, for (rotation, translation) in the camera's frame, rad^2 and m^2:
  /// from the normal equations of the last iteration, scaled by the residuals, as used in the pose graph. It excludes
  /// the drift of the map. Directions determined by neither surface nor brightness have a standard deviation of about 1
  /// rad or 1 m; but without color, the noise of normals is mistaken for structure while the map is young (along a bare
  /// wall the result is then a few millimeters, which is too small). Empty without an alignment: the first frame of a
  /// map or of a component, and given poses.
  std::optional<Matrix6d> covariance;
  double moving = 0.0;  ///< fraction of the image excluded as moving
  InitialGuess guess = InitialGuess::none;
  int touched_bricks = 0;                  ///< bricks that received measurements
  int new_bricks = 0;                      ///< subset of touched_bricks that were new
  std::map<std::string, double> stage_ms;  ///< preprocess, raycast, track, fuse, keyframe, esdf, esdf to host
};

/// Result of Mapper::refine.
struct RefineReport {
  int keyframes = 0;
  int pairs_tried = 0;     ///< covisible keyframe pairs
  int pairs_aligned = 0;   ///< tried pairs with a successful alignment
  int pairs_inlier = 0;    ///< aligned pairs kept by the pose graph
  double cost_before = 0;  ///< half the sum of squared normalized errors of the pose graph
  double cost = 0;         ///< the same after refinement
};

/// Result of Mapper::adjust.
struct AdjustReport {
  int keyframes = 0;           ///< adjusted keyframes
  int surfels = 0;             ///< surfels of the observed surface
  int observations = 0;        ///< observations of the surfels
  double clock_offset = 0;     ///< seconds by which the color camera's clock is ahead of the depth camera's
  double readout = 0;          ///< seconds from the first row to the last, added to the rig's readout
  double readout_sigma = 0;    ///< standard deviation of the readout
  double error_reduction = 0;  ///< relative reduction of held-out surfel errors by the readout
  bool has_readout = false;    ///< the readout is confirmed by held-out surfels
  /// Correction of depth in addition to the rig's; empty if held-out surfels do not confirm it.
  DepthCorrection correction;
  double corrected_error_reduction = 0;  ///< relative reduction of held-out surfel errors by the correction
  /// Covariance of an adjusted keyframe's pose relative to the first one, for `pose * retract(error)`, in radians and
  /// meters. Empty if nothing was adjusted.
  struct KeyframeCovariance {
    double timestamp = 0;  ///< seconds
    Matrix6d covariance = Matrix6d::Zero();
  };
  std::vector<KeyframeCovariance> covariances;
};

/// Optional stage of Mapper::finish.
enum class FinishStage { refine, adjust, reintegrate };

/// Name of the enumerator.
[[nodiscard]] std::string_view to_string(FinishStage stage);

/// Errors of a map at held-out frames, see Frame::held_out.
struct HeldOutError {
  int frames = 0;
  double covered = 0;          ///< share of the measured points with a surface within the truncation
  double depth_rmse = 0;       ///< meters, from these points to the surface
  double brightness_rmse = 0;  ///< 0 to 1, between images and the voxels' colors; 0: no color aligned with depth
  double doubled = 0;          ///< share of these points with another surface within 8 cm along their ray
};

/// Result of Mapper::finish.
struct FinishReport {
  std::optional<RefineReport> refined;   ///< empty if the stage was not requested, or skipped after a cancellation
  std::optional<AdjustReport> adjusted;  ///< same
  bool is_reintegrated = false;          ///< all frames were fused again
  bool has_fused_held_out = false;       ///< including held-out frames
  /// FinishOptions::is_judged: errors before and after the stages; empty with too few held-out frames.
  std::optional<HeldOutError> error_before, error;
  bool is_kept = true;  ///< false: held-out frames did not confirm the stages, and the map is as before
};

/// Keyframe of a map.
struct KeyframeInfo {
  double timestamp = 0;  ///< seconds
  int searched = 0;      ///< earlier keyframes searched for a loop closure

  friend bool operator==(const KeyframeInfo&, const KeyframeInfo&) = default;
};

/// Loop closure between two keyframes.
struct FoundLoop {
  double from = 0;                                             ///< timestamp of keyframe i, seconds
  double to = 0;                                               ///< timestamp of keyframe j, seconds
  Eigen::Isometry3d i_from_j = Eigen::Isometry3d::Identity();  ///< measured
  int feature_inliers = 0;                                     ///< of the perspective-n-point pose
  double inlier_share = 0;                                     ///< from the dense alignment, as in FrameReport
  double rmse = 0;                                             ///< from the dense alignment, as in FrameReport
  bool inlier = true;                                          ///< kept by the pose graph
};

/// Time of a kernel on the device.
struct KernelTime {
  int calls = 0;
  double milliseconds = 0;  ///< total
};

/// Inertial sensors, as estimated with the tracked motion.
struct InertialReport {
  enum class State {
    absent,       ///< no gyroscope with an accelerometer
    untested,     ///< too little motion so far: not used
    trusted,      ///< predicts and corrects poses
    contradicted  ///< contradicts the tracked motion: not used
  };
  State state = State::absent;
  Eigen::Vector3d gyroscope_bias = Eigen::Vector3d::Zero();      ///< rad/s, in axes of the depth camera
  Eigen::Vector3d accelerometer_bias = Eigen::Vector3d::Zero();  ///< m/s^2, same axes
  /// Rotation of the sensor against the rig's axes.
  Eigen::Quaterniond imu_from_camera = Eigen::Quaterniond::Identity();
  Eigen::Vector3d lever = Eigen::Vector3d::Zero();  ///< of the camera from the sensor, m, same axes
  double clock = 0;                                 ///< seconds by which the camera's clock is behind
  double gravity_sigma = 0;                         ///< rad
};

/// `absent`, `untested`, `trusted` or `contradicted`.
[[nodiscard]] std::string_view to_string(InertialReport::State state);

/// Size and cost of a map, and estimates about the camera.
struct Statistics {
  std::string device;                          ///< its name
  std::uint64_t device_memory_peak = 0;        ///< bytes
  std::uint64_t device_waits = 0;              ///< waits of the host for the device
  std::uint64_t uploaded = 0, downloaded = 0;  ///< bytes to the device, and back
  std::uint64_t bricks = 0;                    ///< allocated bricks of 8x8x8 voxels
  std::uint64_t paged_out = 0, paged_in = 0;   ///< bricks moved to the host, and back
  int keyframes = 0;
  int submaps = 0;                       ///< ended submaps
  int components = 0;                    ///< components of the map
  int database_queries = 0;              ///< keyframes searched for in the keyframe database
  int loops_tried = 0;                   ///< keyframe pairs aligned
  double graph_ms = 0;                   ///< longest pose graph optimization
  double world_ms = 0;                   ///< longest update of the global volume
  std::uint64_t submap_memory_peak = 0;  ///< bytes on the host
  std::uint64_t submaps_read_back = 0;   ///< from the disk
  double clock_offset = 0;               ///< seconds by which the color camera's clock is ahead
  FocalEvidence focal;                   ///< evidence for another focal length
  InertialReport inertial;
  std::map<std::string, KernelTime> kernels;  ///< by name
  /// Standard deviation of an adjusted map's surface, meters: median and 95th percentile, see SurfaceSigma. 0: unknown.
  float sigma_median = 0, sigma_95 = 0;
};

}  // namespace cairn
