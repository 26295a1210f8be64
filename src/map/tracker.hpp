// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

#include "base/stopwatch.hpp"
#include "cairn/frame.hpp"
#include "cairn/reports.hpp"
#include "cairn/trajectory.hpp"
#include "map/keyframe.hpp"
#include "place/keyframe_database.hpp"
#include "surface/rectify.hpp"
#include "track/align.hpp"
#include "track/gyroscope.hpp"
#include "volume/raycast.hpp"

namespace cairn {

/// Where a frame was taken, and how sure that is.
struct Tracked {
  enum class State {
    aligned,  // with the map
    begins,   // the map, or after a long loss a component of its own: there is nothing to align with
    lost      // no trustworthy pose
  };
  State state = State::lost;
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();  // unless lost
  Alignment alignment;  // the last one that was tried; not for the map's first frame
  std::string guess;    // where it started: motion, still, features, relocalised, gyroscope
  Eigen::Isometry3d predicted_from = Eigen::Isometry3d::Identity();  // submap_from_camera of the surface predicted then
  FrameCause cause = FrameCause::none;
  std::string reason;  // the cause in words

  /// Of the pose, in the camera's frame; null where there was nothing to align with.
  [[nodiscard]] const Matrix6d* information() const {
    return state == State::aligned ? &alignment.information : nullptr;
  }
};

/// Finds each frame's pose: guesses it, aligns it with the map, tells when it is lost. Two calls a frame: `track`, and
/// `commit` once it is fused.
class Tracker {
 public:
  /// `rig` is the frames', `rectified` the surfaces'. The keyframes are those of the map; somebody else adds to
  /// them, and tells which lie in the frame that is tracked in.
  Tracker(gpu::Device& device, const Rig& rig, const Camera& rectified, const Options& options,
          const KeyframeDatabase& keyframes, const KeyframeStore& images);

  /// The pose of a frame, or why there is none. Takes what moves out of `live`'s fusion image (see
  /// shaders/moving_mask.comp). Of the frame only is kept that it was lost.
  [[nodiscard]] Tracked track(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times);
  /// The pose of a frame that is held out, or why there is none; nothing of it is kept.
  [[nodiscard]] Tracked look(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times);
  /// Share of the image that moves and was taken out of the fusion image, of the last frame. Waits for the device.
  [[nodiscard]] double moving() const;
  /// Hears of the gyroscope's rates, also of frames that are not tracked.
  void listen(const std::vector<AngularRate>& rates) { gyroscope_.add(rates); }
  /// How the camera moves while a frame is taken: before its pose is known, and after.
  [[nodiscard]] MotionAt motion(const Frame& frame) const;
  [[nodiscard]] MotionAt motion(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const;
  /// As `track` does it, of a surface that was made again since.
  void leave_out_moving(const Surface& live, const Tracked& tracked, const Volume& volume);
  /// Tells that the frame was fused at the pose that was found.
  void commit(const Frame& frame, const Surface& live, const Tracked& tracked);
  /// Compares the last two keyframes, if the camera turned between them: see focal().
  void learn_focal_length();

  /// Seconds that the colour camera's clock is ahead of the depth camera's, as far as the images tell.
  [[nodiscard]] double clock_offset() const;
  [[nodiscard]] FocalEvidence focal() const;

  struct Moment {
    double timestamp = 0;
    Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  };
  /// What it knows beside the keyframes, to go on with later.
  struct Memory {
    std::vector<Moment> last;        // at most two fused frames, the newest at the end
    double last_aligned = 0;         // seconds; before the newest where a gyroscope stood in
    bool last_is_weak = false;       // a direction of the newest was not observed
    double usual_brightness = 0.03;  // photometric rmse, a running mean over fused frames
    int lost_frames = 0;             // since the last fused one
    int lost_views = 0;              // those of them that saw something
    std::array<double, kClockOffsets.size()> clock_offset_costs{};  // summed over frames
    int clock_offset_frames = 0;
    std::array<double, kFocalScales.size()> focal_costs{};  // summed over pairs of keyframes
    int focal_pairs = 0;
    std::optional<Eigen::Isometry3d> last_guess;  // Frame::guess of the newest
    double guess_error = 0, motion_error = 0;     // of predictions, running means: radians and metres together
    int guesses = 0;
    int frames_of_view = 0;  // that were aligned with the same prediction of the surface
  };
  /// All that it knows.
  struct Saved {
    Memory memory;
    PhotometricKeyframe::Saved reference;
    Raycaster::Saved prediction;
    Gyroscope::Memory gyroscope;
  };
  [[nodiscard]] Saved save() const;
  void restore(const Saved& saved);
  [[nodiscard]] const Memory& memory() const { return memory_; }
  /// Starts lost in a map with keyframes, as if last seen, long ago, at the newest of them.
  void begin_lost();

 private:
  [[nodiscard]] Tracked begin_map(const Frame& frame) const;
  /// Its pose in the map that there is.
  [[nodiscard]] Tracked find(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times);
  [[nodiscard]] Tracked follow(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times);
  [[nodiscard]] Tracked relocalise(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times);
  [[nodiscard]] bool carries(const Frame& frame) const;
  [[nodiscard]] Tracked carried(const Frame& frame) const;
  [[nodiscard]] static bool sees_enough(const Frame& frame);
  [[nodiscard]] Tracked align(const Frame& frame, const Surface& live, Volume& volume, const Eigen::Isometry3d& guess,
                              const char* name, Reach reach, StageTimes& times);
  [[nodiscard]] Tracked align_with_view(const Frame& frame, const Surface& live, const Eigen::Isometry3d& guess,
                                        const char* name, Reach reach, StageTimes& times);
  /// Whether the surface as it was predicted last is nearly what is seen from the guess.
  [[nodiscard]] bool still_sees(const Eigen::Isometry3d& guess) const;
  /// Whether a component of its own begins: the camera has been lost for long enough and this frame shows something.
  [[nodiscard]] bool gives_up(const Frame& frame);
  /// Forgets the map.
  void restart();

  [[nodiscard]] Eigen::Isometry3d predict(const Frame& frame) const;
  [[nodiscard]] Eigen::Isometry3d predict_by_motion(double timestamp) const;
  [[nodiscard]] std::optional<Eigen::Isometry3d> predict_by_guess(const Frame& frame) const;
  void judge_guess(const Frame& frame, const Eigen::Isometry3d& submap_from_camera);
  [[nodiscard]] UndoneShutter undone(const Frame& frame) const;
  [[nodiscard]] ColourMoment moment_of(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const;

  /// By a keyframe's corners.
  [[nodiscard]] std::optional<PnpPose> locate(std::size_t keyframe, const Features& seen) const;
  /// A guess from the keyframe that shares most corners with the frame, if any.
  [[nodiscard]] std::optional<Eigen::Isometry3d> recognise(const Features& seen,
                                                           const std::vector<std::size_t>& keyframes) const;
  /// The newest keyframes, the newest first.
  [[nodiscard]] std::vector<std::size_t> recent() const;
  /// The keyframes to compare a lost frame with: the most similar ones, and in turn some of the others.
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
  Camera judged_;  // of the level at which moving things are told
  gpu::Buffer verdicts_, moving_count_;
  std::array<std::uint32_t, 1> moving_{};  // pixels of the coarsest level, once the device has counted them
  gpu::Kernel<shader::MovingJudgePush> judge_;
  gpu::Kernel<shader::MovingMaskPush> mask_;
  SurfacePrediction prediction_;  // of the alignment that track found
  Memory memory_;
};

}  // namespace cairn
