// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A recording once more, after its keyframes were adjusted: they are fused first, and what they show is the map that
// the frames between them are tracked against.
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
  /// `rectified`: of the surfaces. `correction`: of the keyframes' depth.
  SecondPass(gpu::Device& device, const Rig& rig, const Camera& rectified, const Options& options,
             const BackEnd& back_end, const DepthCorrection& correction, double clock_offset);

  /// Fuses the keyframes where they were adjusted to. `go_on` is called before each, and may throw.
  void fuse_keyframes(Integrator& integrator, Volume& volume, std::uint32_t& fused_count,
                      const std::function<void()>& go_on);
  /// Whether a frame of this time was fused or held out in the first pass, and into the main piece.
  [[nodiscard]] bool has(double timestamp) const { return index_of(timestamp).has_value(); }
  /// Of the camera when the frame was taken, as the adjusted keyframes say.
  [[nodiscard]] MotionAt motion(double timestamp) const;
  [[nodiscard]] bool is_keyframe(double timestamp) const;
  /// Finds the frame's pose anew; it stays where the alignment is not to be trusted. Of a keyframe it is as adjusted.
  [[nodiscard]] Eigen::Isometry3d track(const Frame& frame, const Surface& live, Volume& volume);
  /// Of all frames of the main piece, as they were found.
  [[nodiscard]] const Trajectory& poses() const { return poses_; }

 private:
  [[nodiscard]] std::optional<std::size_t> index_of(double timestamp) const;

  const BackEnd& back_end_;
  DepthCorrection correction_;
  double clock_offset_;
  std::vector<std::size_t> keyframes_;  // of the main piece
  Trajectory adjusted_, poses_;         // before and after
  Preprocessor preprocessor_;           // of keyframes, whose shutter is undone
  Raycaster raycaster_;
  Aligner aligner_;
  PhotometricKeyframe reference_;
};

}  // namespace cairn
