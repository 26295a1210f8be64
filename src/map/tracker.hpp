// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

#include "base/stopwatch.hpp"
#include "cairn/frame.hpp"
#include "cairn/trajectory.hpp"
#include "place/keyframe_database.hpp"
#include "track/align.hpp"
#include "volume/raycast.hpp"

namespace cairn {

struct Tracked {
  Alignment alignment;
  std::string guess;  // where the alignment started: motion, still, features, relocalised
  Eigen::Isometry3d seen_from =
      Eigen::Isometry3d::Identity();  // submap_from_camera of the map's view that it aligns with
};

/// Finds each frame's pose: guesses it, aligns it with the map, tells when it is lost.
class Tracker {
 public:
  /// `camera` is the frames', `rectified` the surfaces'. The places are those of the map; somebody else adds to them,
  /// and tells which lie in the frame that is tracked in.
  Tracker(gpu::Device& device, const Camera& camera, const Camera& rectified, const Options& options,
          const KeyframeDatabase& places);

  /// The pose of a live surface, or why there is none. Nothing is kept of a frame that is not accepted.
  [[nodiscard]] Tracked operator()(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times);
  /// Takes out of the surface's fusion image what moves: see shaders/moving_mask.comp. Returns its share of the image.
  double leave_out_moving(const Surface& live, const Tracked& tracked, const Volume& volume);
  /// Tells that the frame was fused at this pose. `tracked` is null for the first one.
  void accept(const Frame& frame, const Surface& live, const Eigen::Isometry3d& submap_from_camera,
              const Tracked* tracked);
  void reject() { ++memory_.lost; }
  /// Forgets the map: the next accepted frame is the first of another one.
  void restart();
  /// Compares the last two places, if the camera turned between them: see focal().
  void learn_from_places();

  /// Seconds that the colour camera's clock is ahead of the depth camera's, as far as the images tell.
  [[nodiscard]] double clock_offset() const;
  [[nodiscard]] FocalEvidence focal() const;

  struct Moment {
    double timestamp = 0;
    Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  };
  /// What it knows beside the places, to go on with later.
  struct Memory {
    std::vector<Moment> last;        // at most two accepted frames, the newest at the end
    double usual_brightness = 0.03;  // photometric rmse, a running mean over accepted frames
    int lost = 0;                    // frames since the last accepted one
    std::array<double, kClockOffsets.size()> clock_offset_costs{};  // summed over frames
    int clock_offset_frames = 0;
    std::array<double, kFocalScales.size()> focal_costs{};  // summed over pairs of places
    int focal_pairs = 0;
  };
  [[nodiscard]] const Memory& memory() const { return memory_; }
  [[nodiscard]] const PhotometricKeyframe& keyframe() const { return keyframe_; }
  void restore(const Memory& memory, const PhotometricKeyframe::Saved& keyframe);
  /// Starts lost in a map with places, as if last seen, long ago, at the newest of them.
  void begin_lost();

 private:
  [[nodiscard]] Eigen::Isometry3d predict(double timestamp) const;
  [[nodiscard]] ColourMoment moment_of(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const;

  /// A guess from the place that shares most corners with the frame, if any.
  [[nodiscard]] std::optional<Eigen::Isometry3d> recognise(const Features& seen,
                                                           const std::vector<std::size_t>& places) const;
  /// The newest places, the newest first.
  [[nodiscard]] std::vector<std::size_t> recent() const;
  /// The places to compare a lost frame with: the most similar ones, and in turn some of the others.
  [[nodiscard]] std::vector<std::size_t> candidates(const Features& seen) const;

  gpu::Device& device_;
  TrackOptions options_;
  Camera source_camera_;  // of the frames: with distortion
  const KeyframeDatabase& database_;
  Raycaster raycaster_;
  Aligner aligner_;
  PhotometricKeyframe keyframe_;
  gpu::Buffer moving_count_;
  gpu::Kernel<shader::MovingMaskPush> mask_;
  SurfacePrediction model_;  // the map as last seen by raycast_
  Memory memory_;
};

}  // namespace cairn
