// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

#include "cairn/frame.hpp"
#include "cairn/trajectory.hpp"
#include "place/features.hpp"
#include "surface/stopwatch.hpp"
#include "track/align.hpp"

namespace cairn {

struct Tracked {
  Alignment alignment;
  std::string guess;  // where the alignment started: motion, still, features, relocalised
};

/// Finds each frame's pose: guesses it, aligns it with the map, tells when it is lost.
class Tracker {
 public:
  /// `camera` is the frames', `rectified` the surfaces'.
  Tracker(gpu::Device& device, const Camera& camera, const Camera& rectified, const Options& options);

  /// The pose of a live surface, or why there is none. Nothing is kept of a frame that is not accepted.
  [[nodiscard]] Tracked operator()(const Frame& frame, const Surface& live, const Volume& volume, StageTimes& times);
  /// Takes out of the surface's fusion image what moves: see shaders/moving_mask.comp. Returns its share of the image.
  double leave_out_moving(const Surface& live, const Eigen::Isometry3d& submap_from_camera);
  /// Tells that the frame was fused at this pose. `tracked` is null for the first one.
  void accept(const Frame& frame, const Surface& live, const Eigen::Isometry3d& submap_from_camera,
              const Tracked* tracked);
  void reject() { ++lost_; }

  /// Seconds that the colour camera's clock is ahead of the depth camera's, as far as the images tell.
  [[nodiscard]] double clock_offset() const;
  [[nodiscard]] FocalEvidence focal() const;

 private:
  /// A place that was fused, to be recognised when the camera is lost.
  struct Place {
    Eigen::Isometry3d submap_from_camera;
    Features features;
    Thumbnail thumbnail;
  };
  struct Moment {
    double timestamp;
    Eigen::Isometry3d submap_from_camera;
  };
  [[nodiscard]] Eigen::Isometry3d predict(double timestamp) const;
  [[nodiscard]] ColourMoment moment_of(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const;

  void compare_focal_lengths(const Place& known, const Place& seen);
  /// A guess from the place that the frame shares most corners with, if any; without colour, some of the places' poses.
  [[nodiscard]] std::vector<Eigen::Isometry3d> recognise(const Frame& frame,
                                                         const std::vector<std::size_t>& places) const;
  /// The places to compare with: the likest, and in turn some of the others.
  [[nodiscard]] std::vector<std::size_t> candidates(const Frame& frame) const;

  gpu::Device& device_;
  TrackOptions options_;
  Camera source_camera_;  // of the frames: with distortion
  Raycast raycast_;
  Align align_;
  Keyframe keyframe_;
  gpu::Buffer moving_count_;
  gpu::Kernel<shader::MovingMaskPush> mask_;
  ModelView model_;  // the map as last seen by raycast_
  std::vector<Place> places_;
  std::vector<Moment> last_;        // at most two accepted frames, the newest at the end
  double usual_brightness_ = 0.03;  // photometric rmse, a running mean over accepted frames
  int lost_ = 0;                    // frames since the last accepted one
  std::array<double, kClockOffsets.size()> clock_offset_costs_{};  // summed over frames
  int clock_offset_frames_ = 0;
  std::array<double, kFocalScales.size()> focal_costs_{};  // summed over pairs of places
  int focal_pairs_ = 0;
};

}  // namespace cairn
