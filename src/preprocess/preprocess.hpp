// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/options.hpp"
#include "gpu/kernel.hpp"
#include "preprocess/frame_pyramid.hpp"
#include "preprocess/rectify.hpp"
#include "shaders/surface.h"

namespace cairn {

/// Preprocessor of frames: rectifies, cleans and smooths depth, registers color to depth, and makes the pyramid of
/// points and normals.
class Preprocessor {
 public:
  Preprocessor(gpu::Device& device, const Rig& rig, const SurfaceOptions& options, int levels, int finest_level);
  /// `motion`: of the camera while the frame is taken, for rolling shutters.
  [[nodiscard]] FramePyramid preprocess(const Frame& frame, const MotionAt& motion = at_velocity(Vector6d::Zero()));
  /// The fusion image alone, without levels; without color if it needs registration.
  [[nodiscard]] FramePyramid preprocess_for_fusion(const Frame& frame, const MotionAt& motion);
  /// Corrects the fusion image and the images of `seen`, the last preprocessed frame, for another motion. The levels
  /// keep theirs.
  void correct_fusion(FramePyramid& seen, const Frame& frame, const MotionAt& motion);
  /// Camera of the finest level: the source's depth camera, without distortion.
  [[nodiscard]] const Camera& camera() const { return levels_.front().camera; }

 private:
  /// Output of a stage: depth and color by pixel of one camera.
  struct Images {
    const gpu::Buffer *depth, *color;
  };
  void upload(const Frame& frame, bool has_color, gpu::Batch& batch);
  [[nodiscard]] Images rectify(const Frame& frame, const MotionAt& motion, gpu::Batch& batch);
  void prepare_registration(const Images& images, const MotionAt& motion, bool has_color, gpu::Batch& batch);
  [[nodiscard]] std::function<const Frame&()> images_at_once(const Frame& frame, const MotionAt& motion);
  void filter(const Images& images, bool smooths, gpu::Batch& batch);
  void find_nearest(const gpu::Buffer& depth, gpu::Batch& batch);
  void register_color_to_depth(const gpu::Buffer& depth, gpu::Batch& batch);
  void make_pyramid(gpu::Batch& batch, bool has_color);
  void make_intensity(gpu::Batch& batch, int level);

  gpu::Device& device_;
  Rig rig_;
  SurfaceOptions options_;
  int finest_level_;
  std::vector<VertexNormalMap> levels_;
  std::vector<gpu::Buffer> smooth_;  // depth by level
  std::vector<gpu::Buffer> intensity_, packed_;
  gpu::Buffer raw_depth_, raw_color_, fusion_;
  gpu::Buffer nearest_;  // for a separate color camera
  bool has_registered_color_ = false;
  std::optional<Rectifier> rectifier_;  // for a depth camera with distortion or a rolling shutter
  std::optional<GlobalShutter> global_shutter_;
  shader::ShutterMotion color_motion_{};  // of the last frame
  gpu::Kernel<shader::SurfaceColorPush> find_nearest_, register_color_to_depth_;
  gpu::Kernel<shader::SurfaceBrightnessPush> make_brightness_;
  gpu::Kernel<shader::SurfaceFilterPush> filter_;
  gpu::Kernel<shader::SurfaceHalfPush> half_;
  gpu::Kernel<shader::SurfaceIntensityPush> make_intensity_;
  gpu::Kernel<shader::SurfacePointsPush> make_points_;
};

}  // namespace cairn
