// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <optional>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/pose.hpp"
#include "gpu/kernel.hpp"
#include "shaders/surface.h"

namespace cairn {

/// Motion of the depth camera: maps from its frame at `delay` seconds after a frame's time to its frame at the frame's
/// time.
using MotionAt = std::function<Eigen::Isometry3d(double delay)>;

/// Motion at a constant velocity in the camera's own frame, rad/s and m/s.
[[nodiscard]] MotionAt at_velocity(const Vector6d& velocity);

/// The same motion in the color camera's frame.
[[nodiscard]] MotionAt color_motion(const Rig& rig, const MotionAt& motion);
/// Maximum offset of the first or last row between two motions, in pixels at a distance of one meter.
[[nodiscard]] double shutter_difference(const Rig& rig, const MotionAt& a, const MotionAt& b);
/// Kernel parameters of a motion.
[[nodiscard]] shader::ShutterMotion shutter_motion(const MotionAt& motion, double readout);

/// Removes lens distortion and rolling shutter from depth and registered color, see shaders/surface_rectify.comp.
class Rectifier {
 public:
  /// `has_color`: color is registered to depth.
  Rectifier(gpu::Device& device, const Camera& camera, bool has_color);
  /// `distance`: assumed for pixels without depth, meters.
  void operator()(gpu::Batch& batch, const MotionAt& motion, float distance, const gpu::Buffer& raw_depth,
                  const gpu::Buffer& raw_color);
  [[nodiscard]] const gpu::Buffer& depth() const { return depth_; }
  [[nodiscard]] const gpu::Buffer& color() const { return color_; }

 private:
  Camera camera_;
  gpu::Buffer depth_, color_, no_rays_;
  gpu::Kernel<shader::SurfaceRectifyPush> rectify_;
};

/// Corrects rolling shutter images to a global shutter at the frame's time. Distortion and size stay the same; the host
/// keeps some of these images.
class GlobalShutter {
 public:
  GlobalShutter(gpu::Device& device, const Rig& rig);
  [[nodiscard]] Frame operator()(const Frame& frame, const MotionAt& motion);

 private:
  /// Device buffers and the correction kernel of one camera.
  class Images {
   public:
    Images(gpu::Device& device, const Camera& camera, bool has_depth, bool has_color);
    /// Without depth, all pixels are assumed at `distance`, meters. A null pointer: no such image.
    void correct(const MotionAt& motion, float distance, std::vector<float>* depth, std::vector<std::uint32_t>* color);

   private:
    gpu::Device& device_;
    Camera camera_;
    gpu::Buffer depth_, color_, rays_, global_depth_, global_color_;
    gpu::Kernel<shader::SurfaceRectifyPush> correct_;
  };
  Rig rig_;
  std::optional<Images> depth_, color_;  // of cameras with a readout
};

/// Median of the measured depths, meters; a few meters if there are none.
[[nodiscard]] float median_depth(const std::vector<float>& depth);

}  // namespace cairn
