// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/frame.hpp"
#include "cairn/options.hpp"
#include "gpu/kernel.hpp"
#include "shaders/surface.h"
#include "surface/rectify.hpp"
#include "surface/surface.hpp"

namespace cairn {

/// Preprocessor of frames: rectifies, cleans and smooths depth, registers color to depth, and makes the pyramid of
/// points and normals.
class Preprocessor {
 public:
  Preprocessor(gpu::Device& device, const Rig& rig, const SurfaceOptions& options, int levels, int finest_level);
  /// `motion`: of the camera while the frame is taken, for rolling shutters.
  [[nodiscard]] Surface preprocess(const Frame& frame, const MotionAt& motion = at_velocity(Vector6d::Zero()));
  /// Camera of the finest level: the source's depth camera, without distortion.
  [[nodiscard]] const Camera& camera() const { return levels_.front().camera; }

 private:
  /// Output of a stage: depth and color by pixel of one camera.
  struct Images {
    const gpu::Buffer *depth, *colour;
  };
  void find_nearest(const gpu::Buffer& depth, gpu::Batch& batch);
  void bring_colour(const gpu::Buffer& depth, gpu::Batch& batch);
  void make_pyramid(gpu::Batch& batch, bool has_colour);
  void make_intensity(gpu::Batch& batch, int level);

  gpu::Device& device_;
  Rig rig_;
  SurfaceOptions options_;
  int finest_level_;
  std::vector<VertexNormalMap> levels_;
  std::vector<gpu::Buffer> smooth_;  // depth by level
  std::vector<gpu::Buffer> intensity_, packed_;
  gpu::Buffer raw_depth_, raw_colour_, fusion_;
  gpu::Buffer nearest_;  // for a separate color camera
  bool has_brought_colour_ = false;
  std::optional<Rectifier> rectifier_;  // for a depth camera with distortion or a rolling shutter
  std::optional<GlobalShutter> global_shutter_;
  shader::ShutterMotion colour_motion_{};  // of the last frame
  gpu::Kernel<shader::SurfaceColourPush> find_nearest_, bring_colour_;
  gpu::Kernel<shader::SurfaceBrightnessPush> make_brightness_;
  gpu::Kernel<shader::SurfaceFilterPush> filter_;
  gpu::Kernel<shader::SurfaceHalfPush> half_;
  gpu::Kernel<shader::SurfaceIntensityPush> make_intensity_;
  gpu::Kernel<shader::SurfacePointsPush> make_points_;
};

}  // namespace cairn
