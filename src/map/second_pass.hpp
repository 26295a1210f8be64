// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Second pass over a recording after its keyframes were adjusted: fuses the keyframes first, and tracks the frames
// between them against this map.
#pragma once
#include <functional>

#include "cairn/frame.hpp"
#include "cairn/trajectory.hpp"
#include "map/back_end.hpp"
#include "surface/preprocess.hpp"
#include "track/align.hpp"
#include "volume/integrate.hpp"
#include "volume/raycast.hpp"

namespace cairn {

class SecondPass {
 public:
  /// `rectified`: camera of the surfaces. `correction`: of the keyframes' depth.
  SecondPass(gpu::Device& device, const Rig& rig, const Camera& rectified, const Options& options,
             const BackEnd& back_end, const DepthCorrection& correction, double clock_offset);

  /// Fuses the keyframes at their adjusted poses. `go_on` is called before each, and may throw.
  void fuse_keyframes(Integrator& integrator, Volume& volume, std::uint32_t& fused_count,
                      const std::function<void()>& go_on);
  /// True if the first pass fused or held out a frame with this timestamp, in the main component.
  [[nodiscard]] bool has(double timestamp) const { return index_of(timestamp).has_value(); }
  /// Motion of the camera at a frame's time, from the adjusted keyframes.
  [[nodiscard]] MotionAt motion(double timestamp) const;
  [[nodiscard]] bool is_keyframe(double timestamp) const;
  /// Tracks the frame again and returns its pose; the adjusted pose if the alignment is unreliable or the frame is a
  /// keyframe.
  [[nodiscard]] Eigen::Isometry3d track(const Frame& frame, const Surface& live, Volume& volume);
  /// Poses of all frames of the main component, updated by track().
  [[nodiscard]] const Trajectory& poses() const { return poses_; }

 private:
  [[nodiscard]] std::optional<std::size_t> index_of(double timestamp) const;

  const BackEnd& back_end_;
  DepthCorrection correction_;
  double clock_offset_;
  std::vector<std::size_t> keyframes_;  // of the main component
  Trajectory adjusted_, poses_;         // before and after tracking
  Preprocessor preprocessor_;           // of keyframes, already corrected for the shutter
  Raycaster raycaster_;
  Aligner aligner_;
  PhotometricKeyframe reference_;
};

}  // namespace cairn
