// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <optional>

#include "cairn/frame.hpp"
#include "cairn/pose.hpp"
#include "gpu/kernel.hpp"
#include "shaders/surface.h"

namespace cairn {

/// From the depth camera as it is so many seconds after a frame's time to itself at that time.
using MotionAt = std::function<Eigen::Isometry3d(double delay)>;

/// That of a constant velocity in its own frame, rad/s and m/s.
[[nodiscard]] MotionAt at_velocity(const Vector6d& velocity);

[[nodiscard]] inline bool is_rolling(const Rig& rig) { return rig.depth.readout > 0 || rig.colour_view().readout > 0; }
/// The rig of images whose shutter is undone.
[[nodiscard]] Rig at_one_moment(Rig rig);
/// The same motion as the colour camera makes it.
[[nodiscard]] MotionAt colour_motion(const Rig& rig, const MotionAt& motion);
/// How far apart two motions put the first or the last row, pixels at a metre's distance.
[[nodiscard]] double shutter_difference(const Rig& rig, const MotionAt& a, const MotionAt& b);
/// What kernels are told of it.
[[nodiscard]] shader::ShutterMotion shutter_motion(const MotionAt& motion, double readout);

/// Undoes lens and rolling shutter of depth and of what lies on it, see shaders/surface_rectify.comp.
class Rectifier {
 public:
  /// `has_colour`: it lies on depth.
  Rectifier(gpu::Device& device, const Camera& camera, bool has_colour);
  /// `distance` in metres: of what has no depth.
  void operator()(gpu::Batch& batch, const MotionAt& motion, float distance, const gpu::Buffer& raw_depth,
                  const gpu::Buffer& raw_colour);
  [[nodiscard]] const gpu::Buffer& depth() const { return depth_; }
  [[nodiscard]] const gpu::Buffer& colour() const { return colour_; }

 private:
  Camera camera_;
  gpu::Buffer depth_, colour_, no_rays_;
  gpu::Kernel<shader::SurfaceRectifyPush> rectify_;
};

/// Turns the images of a rolling shutter into those that the cameras would have taken at once, at the frame's time.
/// Lens and size stay: these are for the host, which keeps some of them.
class GlobalShutter {
 public:
  GlobalShutter(gpu::Device& device, const Rig& rig);
  [[nodiscard]] Frame operator()(const Frame& frame, const MotionAt& motion);

 private:
  /// One camera's images on the device, and what makes others of them.
  class Images {
   public:
    Images(gpu::Device& device, const Camera& camera, bool has_depth, bool has_colour);
    /// Without depth all is taken to be at `distance`, metres. A null pointer: no such image.
    void undo(const MotionAt& motion, float distance, std::vector<float>* depth, std::vector<std::uint32_t>* colour);

   private:
    gpu::Device& device_;
    Camera camera_;
    gpu::Buffer depth_, colour_, rays_, global_depth_, global_colour_;
    gpu::Kernel<shader::SurfaceRectifyPush> undo_;
  };
  Rig rig_;
  std::optional<Images> depth_, colour_;  // of cameras with a readout
};

/// Half of the measurements are nearer, metres; a few metres where there is none.
[[nodiscard]] float median_depth(const std::vector<float>& depth);

}  // namespace cairn
