// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Sources of a map's poses: estimated by tracking, or given with the frames. Both classes have the same functions.
#pragma once
#include <optional>
#include <variant>
#include <vector>

#include "base/stopwatch.hpp"
#include "mapper/back_end.hpp"
#include "mapper/checked_frame.hpp"
#include "mapper/tracker.hpp"
#include "preprocess/preprocess.hpp"

namespace cairn {

/// Poses::tracked: estimated by the tracker, corrected by the back end's pose graph.
class TrackedPoses {
 public:
  TrackedPoses(const Rig& rig, Preprocessor& preprocessor, Volume& volume, BackEnd& back_end, Tracker& tracker,
               RepeatedImages& repeats)
      : rig_(rig),
        preprocessor_(preprocessor),
        volume_(volume),
        back_end_(back_end),
        tracker_(tracker),
        repeats_(repeats) {}

  /// Rejects a frame of a stuck camera.
  void check(const Frame& frame, CheckedFrame& checked);
  /// Preprocesses and tracks a frame.
  [[nodiscard]] TrackingResult track(const Frame& frame, FramePyramid& seen, StageTimes& times);
  /// Pose of the last fused frame.
  [[nodiscard]] std::optional<Eigen::Isometry3d> last() const;
  /// Commits a fused frame: to the tracker, and to the back end as a possible keyframe.
  void commit(const Frame& frame, const FramePyramid& live, const TrackingResult& tracked, std::uint32_t fused_count,
              StageTimes& times);
  /// Stores the pose of a held-out frame. Returns false if there is no map around the frame yet.
  [[nodiscard]] bool hold_out(const Frame& frame, const TrackingResult& tracked);

  [[nodiscard]] GravityAlignment upright() const { return back_end_.atlas().upright(); }
  /// Poses of a recording, in the tracking frame; -1: the last.
  [[nodiscard]] Trajectory trajectory(int recording) const;
  /// At most `points` poses of the last recording, at least two, including the first and the newest.
  [[nodiscard]] Trajectory path(std::size_t points) const;
  /// Images of the keyframes.
  [[nodiscard]] const KeyframeStore& images() const { return back_end_.images(); }

 private:
  const Rig& rig_;
  Preprocessor& preprocessor_;
  Volume& volume_;
  BackEnd& back_end_;
  Tracker& tracker_;
  RepeatedImages& repeats_;
};

/// Poses::given: Frame::world_from_camera.
class GivenPoses {
 public:
  GivenPoses(const Rig& rig, const Options& options, Preprocessor& preprocessor, const BackEnd& back_end)
      : rig_(rig), options_(options), preprocessor_(preprocessor), back_end_(back_end), images_(rig, {}) {}

  /// Rejects a frame without a valid pose.
  void check(const Frame&, CheckedFrame& checked) const { checked.expect_pose(options_.fuse.voxel_size); }
  /// Preprocesses a frame and returns its given pose.
  [[nodiscard]] TrackingResult track(const Frame& frame, FramePyramid& seen, StageTimes& times);
  /// Pose of the last fused or held-out frame.
  [[nodiscard]] std::optional<Eigen::Isometry3d> last() const;
  /// Stores a fused frame's pose, possibly as a keyframe for textures and as evidence for gravity.
  void commit(const Frame& frame, const FramePyramid& live, const TrackingResult& tracked, std::uint32_t fused_count,
              StageTimes& times);
  /// Stores the pose of a held-out frame. Returns true.
  [[nodiscard]] bool hold_out(const Frame& frame, const TrackingResult& tracked);

  [[nodiscard]] GravityAlignment upright() const;
  /// Poses of the only recording.
  [[nodiscard]] Trajectory trajectory(int) const { return poses_; }
  /// At most `points` of the poses, at least two, including the first and the newest.
  [[nodiscard]] Trajectory path(std::size_t points) const;
  /// Images of the keyframes, with Options::keep_keyframes.
  [[nodiscard]] const KeyframeStore& images() const { return images_; }

  struct Keyframe {
    std::size_t pose = 0;    // index into poses()
    double color_delay = 0;  // seconds, see Frame
  };
  [[nodiscard]] const std::vector<Keyframe>& keyframes() const { return keyframes_; }
  [[nodiscard]] const Trajectory& poses() const { return poses_; }

 private:
  struct View {
    std::size_t pose = 0;  // index into poses_
    Structure structure;
  };
  void add_keyframe(const Frame& frame, const FramePyramid& live);
  void add_gravity_evidence(const Frame& frame, const FramePyramid& live);

  const Rig& rig_;
  const Options& options_;
  Preprocessor& preprocessor_;
  const BackEnd& back_end_;
  Trajectory poses_;
  KeyframeStore images_;
  std::vector<Keyframe> keyframes_;
  std::vector<View> views_;                                  // surface orientations
  Eigen::Vector4d accelerations_ = Eigen::Vector4d::Zero();  // see GravityEvidence
};

using PoseSource = std::variant<TrackedPoses, GivenPoses>;

}  // namespace cairn
