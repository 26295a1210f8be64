// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

#include "alignment/align.hpp"
#include "alignment/device_odometry.hpp"
#include "alignment/gyroscope.hpp"
#include "base/stopwatch.hpp"
#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/reports.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "inertial/inertial_odometry.hpp"
#include "map/keyframe.hpp"
#include "mapper/tracking_criteria.hpp"
#include "place/keyframe_database.hpp"
#include "preprocess/preprocess.hpp"
#include "preprocess/rectify.hpp"
#include "volume/raycast.hpp"

namespace cairn {

/// Tracking result: pose of a frame, with its uncertainty.
struct TrackingResult {
  enum class State {
    aligned,      // with the map
    initialized,  // starts the map or, after a long loss, a new component: no map to align with
    lost          // no reliable pose
  };
  State state = State::lost;
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();  // unless lost
  Alignment alignment;                 // last attempted alignment; unset for the first frame of a map
  std::optional<AlignedPose> aligned;  // before the fusion with the device's motion
  std::optional<InertialOdometry::TrackedPose> measured;  // before the fusion with the inertial prediction
  std::optional<InertialOdometry::Prediction>
      before_break;  // of a new component: its pose in the preceding one's frame
  InitialGuess guess = InitialGuess::none;
  Eigen::Isometry3d predicted_from = Eigen::Isometry3d::Identity();  // submap_from_camera of the predicted surface
  FrameCause cause = FrameCause::none;
  std::string reason;  // the cause as text

  /// Information of the pose in the camera's frame; null without an alignment.
  [[nodiscard]] const Matrix6d* information() const {
    return state == State::aligned ? &alignment.information : nullptr;
  }
};

/// Tracks the camera: predicts each frame's pose, aligns the frame with the map, and detects tracking loss. Two calls
/// per frame: `track`, and `commit` once the frame is fused.
class Tracker {
 public:
  /// `rig`: of the frames. `rectified`: camera of the surfaces. `keyframes`: those of the map, owned and extended by
  /// the caller, which also marks the keyframes with a known pose in the tracking frame.
  Tracker(gpu::Device& device, const Rig& rig, const Camera& rectified, const Options& options,
          const KeyframeDatabase& keyframes, const KeyframeStore& images);

  /// Tracks a frame; the result has a cause if there is no pose. Removes moving pixels from `live`'s fusion image (see
  /// shaders/moving_mask.comp). Before commit(), a frame affects only the loss state and the cached prediction.
  [[nodiscard]] TrackingResult track(const Frame& frame, const FramePyramid& live, Volume& volume, StageTimes& times);
  /// Tracks a held-out frame without any change of state.
  [[nodiscard]] TrackingResult track_only(const Frame& frame, const FramePyramid& live, Volume& volume,
                                          StageTimes& times);
  /// Share of the image removed from the last fusion image as moving. Waits for the device.
  [[nodiscard]] double moving() const;
  /// Adds the inertial samples of a frame, also of an untracked one.
  void add_inertial(const Frame& frame);
  /// Motion of the camera while a frame is taken: predicted, and with the frame's pose.
  [[nodiscard]] MotionAt motion(const Frame& frame) const;
  [[nodiscard]] MotionAt motion(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const;
  /// True if commit() will take the frame as photometric reference.
  [[nodiscard]] bool is_reference_due(const FramePyramid& live, const TrackingResult& tracked) const;
  /// Removes moving pixels as `track` does, from a corrected fusion image.
  void mask_moving(const FramePyramid& live, const TrackingResult& tracked, const Volume& volume);
  /// Commits a fused frame with its tracked pose.
  void commit(const Frame& frame, const FramePyramid& live, const TrackingResult& tracked);
  /// Adds evidence for focal() from the last two keyframes, if the camera turned between them.
  void add_focal_evidence();

  /// Estimated seconds by which the color camera's clock is ahead of the depth camera's.
  [[nodiscard]] double clock_offset() const;
  [[nodiscard]] FocalEvidence focal() const;
  /// Contradiction of the inertial sensor with the tracked motion, a line; empty: none.
  [[nodiscard]] std::string inertial_contradiction() const;
  /// Inertial measurements of a keyframe at the last committed frame.
  [[nodiscard]] InertialKeyframe take_inertial_keyframe();
  [[nodiscard]] const InertialOdometry& inertial() const { return inertial_; }
  /// Estimated drift of the frames' device poses; none if they are not used as measurements.
  [[nodiscard]] std::optional<DeviceDrift> device_drift() const;

  struct Moment {
    double timestamp = 0;
    Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  };
  /// State in addition to the keyframes, for resuming.
  struct State {
    std::vector<Moment> last;         // at most two fused frames, newest last
    double last_aligned = 0;          // seconds; before the newest frame if the gyroscope replaced the alignment
    bool last_is_degenerate = false;  // the newest pose has an unobserved direction
    TypicalFit typical;
    int lost_frames = 0;                                            // since the last fused frame
    int lost_views = 0;                                             // lost frames with enough depth
    std::array<double, kClockOffsets.size()> clock_offset_costs{};  // summed over frames
    int clock_offset_frames = 0;
    std::array<double, kFocalScales.size()> focal_costs{};  // summed over pairs of keyframes
    int focal_pairs = 0;
    std::optional<Eigen::Isometry3d> last_guess;  // Frame::guess of the newest frame
    double guess_error = 0, motion_error = 0;     // running means of the prediction errors: rad and m summed
    int guesses = 0;
    int frames_of_prediction = 0;  // frames aligned with the current predicted surface
    DeviceOdometry device;
  };
  /// Complete state.
  struct SavedState {
    State state;
    PhotometricKeyframe::SavedState reference;
    Raycaster::SavedState prediction;
    Gyroscope::State gyroscope;
    InertialOdometry::State inertial;
  };
  [[nodiscard]] SavedState save() const;
  void restore(const SavedState& saved);
  [[nodiscard]] const State& state() const { return state_; }
  /// Starts lost in a map with keyframes, as if the camera was last seen at the newest keyframe, long ago.
  void start_lost();
  /// Tracks in a map that stays unchanged: removes no moving pixels, and relocalizes a lost camera also by the
  /// brightness of stored keyframes, from several of them. `keyframes`: preprocessor for them; null if their cameras
  /// are not those of the frames. Must outlive the tracker.
  void localize_only(Preprocessor* keyframes) {
    removes_moving_ = false;
    keyframe_preprocessor_ = keyframes;
  }

 private:
  [[nodiscard]] TrackingResult start_map(const Frame& frame) const;
  /// Tracks or relocalizes in the existing map.
  [[nodiscard]] TrackingResult track_in_map(const Frame& frame, const FramePyramid& live, Volume& volume,
                                            StageTimes& times);
  [[nodiscard]] TrackingResult track_frame(const Frame& frame, const FramePyramid& live, Volume& volume,
                                           StageTimes& times);
  [[nodiscard]] TrackingResult relocalize(const Frame& frame, const FramePyramid& live, Volume& volume,
                                          StageTimes& times);
  [[nodiscard]] bool is_gyro_usable(const Frame& frame) const;
  [[nodiscard]] TrackingResult gyro_prediction(const Frame& frame) const;
  /// Prediction by the inertial sensor; empty if it is not accurate enough to replace an alignment.
  [[nodiscard]] std::optional<InertialOdometry::Prediction> inertial_prediction(double timestamp) const;
  /// True if an alignment confirms the pose from the inertial sensor.
  [[nodiscard]] bool confirms_inertial(const Frame& frame, const TrackingResult& tracked) const;
  /// Fuses an alignment with the inertial prediction where brightness does not confirm it, or directions are
  /// unobserved.
  void fuse_inertial_prediction(const Frame& frame, TrackingResult& tracked) const;
  /// The alignment as a measurement for the inertial odometry.
  [[nodiscard]] InertialOdometry::TrackedPose measurement_of(const Frame& frame, const TrackingResult& tracked) const;
  [[nodiscard]] bool is_device_usable(const Frame& frame) const;
  [[nodiscard]] TrackingResult device_prediction(const Frame& frame) const;
  [[nodiscard]] Matrix6d device_motion_covariance(const Eigen::Isometry3d& predicted) const;
  /// Fuses an alignment with the device's motion since the last fused frame, if the two agree.
  void fuse_device_motion(const Frame& frame, TrackingResult& tracked) const;
  [[nodiscard]] static bool has_enough_depth(const Frame& frame);
  [[nodiscard]] TrackingResult align(const Frame& frame, const FramePyramid& live, Volume& volume,
                                     const Eigen::Isometry3d& guess, InitialGuess kind, AlignmentRange range,
                                     StageTimes& times);
  [[nodiscard]] TrackingResult align_with_prediction(const Frame& frame, const FramePyramid& live,
                                                     const Eigen::Isometry3d& guess, InitialGuess kind,
                                                     AlignmentRange range, StageTimes& times);
  /// True if the last predicted surface is nearly the view from the guess.
  [[nodiscard]] bool is_prediction_reusable(const Eigen::Isometry3d& guess) const;
  /// True if a new component starts: the camera has been lost long enough and this frame has enough depth.
  [[nodiscard]] bool should_start_component(const Frame& frame);
  /// Resets tracking for a new component.
  void reset();

  /// True if the view changes too fast for a motion model: at a low frame rate.
  [[nodiscard]] bool is_view_wide(const Eigen::Isometry3d& predicted) const;
  [[nodiscard]] Eigen::Isometry3d predict(const Frame& frame) const;
  [[nodiscard]] Eigen::Isometry3d predict_by_motion(double timestamp) const;
  [[nodiscard]] std::optional<Eigen::Isometry3d> predict_by_guess(const Frame& frame) const;
  void update_prediction_errors(const Frame& frame, const Eigen::Isometry3d& submap_from_camera);
  [[nodiscard]] ShutterCorrection shutter_correction(const Frame& frame) const;
  [[nodiscard]] ColorMoment moment_of(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const;

  /// Pose relative to a keyframe, by features.
  [[nodiscard]] std::optional<PnpPose> solve_keyframe_pnp(std::size_t keyframe, const Features& seen) const;
  /// Guess from the features of a keyframe.
  struct FeaturePose {
    std::size_t keyframe = 0;
    Eigen::Isometry3d tracked_from_camera = Eigen::Isometry3d::Identity();
    int inliers = 0;
  };
  /// Guesses from keyframes, the one with the most feature inliers first.
  [[nodiscard]] std::vector<FeaturePose> poses_by_features(const Features& seen,
                                                           const std::vector<std::size_t>& keyframes) const;
  /// The first of them, if any.
  [[nodiscard]] std::optional<Eigen::Isometry3d> estimate_pose_by_features(
      const Features& seen, const std::vector<std::size_t>& keyframes) const;
  /// Takes a stored keyframe as photometric reference. Returns false without color or file.
  [[nodiscard]] bool set_reference(std::size_t keyframe);
  /// The newest keyframes, newest first.
  [[nodiscard]] std::vector<std::size_t> recent_keyframes() const;
  /// Keyframes to compare a lost frame with: the most similar ones, and a rotating subset of the rest.
  [[nodiscard]] std::vector<std::size_t> candidates(const Features& seen) const;

  gpu::Device& device_;
  Options options_;
  Rig rig_;  // of the frames
  const KeyframeDatabase& keyframes_;
  const KeyframeStore& images_;
  Raycaster raycaster_;
  Aligner aligner_;
  PhotometricKeyframe reference_;
  Gyroscope gyroscope_;
  InertialOdometry inertial_;
  Camera judged_;  // of the pyramid level for motion detection
  gpu::Buffer verdicts_, moving_count_;
  std::array<std::uint32_t, 1> moving_{};  // pixels of the coarsest level, valid after the device has finished
  gpu::Kernel<shader::MovingJudgePush> judge_;
  gpu::Kernel<shader::MovingMaskPush> mask_;
  SurfacePrediction prediction_;  // of the alignment returned by track
  bool removes_moving_ = true;
  Preprocessor* keyframe_preprocessor_ = nullptr;
  State state_;
};

}  // namespace cairn
