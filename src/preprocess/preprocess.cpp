// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "preprocess/preprocess.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/readout.hpp"
#include "shaders/surface_color.h"
#include "spirv/surface_brightness.comp.h"
#include "spirv/surface_color.comp.h"
#include "spirv/surface_filter.comp.h"
#include "spirv/surface_half.comp.h"
#include "spirv/surface_intensity.comp.h"
#include "spirv/surface_nearest.comp.h"
#include "spirv/surface_points.comp.h"

namespace cairn {
namespace {

std::uint32_t pixels(const Camera& camera) { return static_cast<std::uint32_t>(camera.width * camera.height); }
std::array<std::uint32_t, 3> threads(const Camera& camera) {  // one per pixel
  return {static_cast<std::uint32_t>(camera.width), static_cast<std::uint32_t>(camera.height), 1};
}

shader::ColorView color_view(const Camera& depth, const ColorCamera& color) {
  const double pixels_each = color.camera.fx / depth.fx;  // color pixels per depth pixel, along a side
  Eigen::Matrix3d ray_of_pixel;
  ray_of_pixel << 1 / depth.fx, 0, -depth.cx / depth.fx, 0, 1 / depth.fy, -depth.cy / depth.fy, 0, 0, 1;
  const Eigen::Matrix3f turn = (color.color_from_depth.linear() * ray_of_pixel).cast<float>();
  return {
      .camera = shader::pinhole(color.camera),
      .lens = shader::lens_bend(color.camera),
      .color_from_depth = {turn.col(0), turn.col(1), turn.col(2), color.color_from_depth.translation().cast<float>()},
      .widest = static_cast<float>(color.camera.widest_ray()),
      .cell = 2 * std::max(static_cast<std::uint32_t>(std::ceil(pixels_each)), 1u),
      .mean = static_cast<std::uint32_t>(std::clamp(std::lround(pixels_each), 1L, 8L)),
      .is_rolling = color.camera.readout > 0 ? 1u : 0u};
}

/// Size in bytes of the buffer of depths nearest to the color camera.
std::uint64_t nearest_bytes(const shader::ColorView& view) {
  const auto cells = [&](std::uint32_t side) { return std::uint64_t{(side + view.cell - 1) / view.cell}; };
  return 4 * cells(view.camera.width) * cells(view.camera.height);
}

/// Specialization constants of the kernels for a separate color camera; without one they do not run.
std::vector<float> constants_of(const Rig& rig, int finest_level) {
  const shader::ColorView view = rig.color ? color_view(rig.depth.rectified(), *rig.color) : shader::ColorView{};
  return shader::constants_of(rig.sensor, view, 1u << finest_level);
}

std::vector<float> filter_constants(const Rig& rig, int finest_level) {
  const auto sensor = shader::constants_of(rig.sensor);
  std::vector<float> all(sensor.begin(), sensor.end());
  all.insert(all.end(), {rig.color ? 0.0f : 1.0f, finest_level == 0 ? 1.0f : 0.0f});
  return all;
}

}  // namespace

Preprocessor::Preprocessor(gpu::Device& device, const Rig& rig, const SurfaceOptions& options, int levels,
                           int finest_level)
    : device_(device),
      rig_(rig),
      options_(options),
      finest_level_(finest_level),
      raw_depth_(device, 4 * std::uint64_t{pixels(rig.depth)}),
      raw_color_(device, 4 * std::uint64_t{pixels(rig.color_view())}),
      fusion_(device, 8 * std::uint64_t{pixels(rig.depth)}),
      find_nearest_(device, "surface_nearest", surface_nearest_comp, constants_of(rig, finest_level)),
      register_color_to_depth_(device, "surface_color", surface_color_comp, constants_of(rig, finest_level)),
      make_brightness_(device, "surface_brightness", surface_brightness_comp, constants_of(rig, finest_level)),
      filter_(device, "surface_filter", surface_filter_comp, filter_constants(rig, finest_level)),
      half_(device, "surface_half", surface_half_comp, shader::constants_of(rig.sensor)),
      make_intensity_(device, "surface_intensity", surface_intensity_comp),
      make_points_(device, "surface_points", surface_points_comp, shader::constants_of(rig.sensor)) {
  for (int level = 0; level < levels; ++level) {
    const Camera c = rig.depth.rectified().at_level(level);
    levels_.push_back({c, gpu::Buffer(device, 8 * std::uint64_t{pixels(c)})});
    smooth_.emplace_back(device, level > 0 || finest_level == 0 ? 4 * std::uint64_t{pixels(c)} : 4);
    const bool is_used = level >= finest_level;
    intensity_.emplace_back(device, is_used ? 4 * std::uint64_t{pixels(c)} : 4);
    packed_.emplace_back(device, is_used ? 8 * std::uint64_t{pixels(c)} : 8);
  }
  if (rig.depth.distorted() || rig.depth.readout > 0) rectifier_.emplace(device, rig.depth, !rig.color);
  if (is_rolling(rig)) global_shutter_.emplace(device, rig);
  if (rig.color) nearest_ = gpu::Buffer(device, nearest_bytes(color_view(rig.depth.rectified(), *rig.color)));
}

void Preprocessor::upload(const Frame& frame, bool has_color, gpu::Batch& batch) {
  batch.upload(raw_depth_, frame.depth);
  if (has_color) batch.upload(raw_color_, frame.color);
}

/// Removes distortion and rolling shutter from the uploaded frame.
Preprocessor::Images Preprocessor::rectify(const Frame& frame, const MotionAt& motion, gpu::Batch& batch) {
  if (!rectifier_) return {&raw_depth_, &raw_color_};
  const float distance = rig_.depth.readout > 0 ? median_depth(frame.depth) : 0.0f;
  (*rectifier_)(batch, motion, distance, raw_depth_, raw_color_);
  return {&rectifier_->depth(), &rectifier_->color()};
}

void Preprocessor::filter(const Images& images, bool smooths, gpu::Batch& batch) {
  const auto width = static_cast<std::uint32_t>(rig_.depth.width),
             height = static_cast<std::uint32_t>(rig_.depth.height);
  filter_(batch, {(width + 3) / 4 + width % 2, (height + 1) / 2, 1},
          {.width = width,
           .height = height,
           .min_depth = options_.min_depth,
           .max_depth = options_.max_depth,
           .spatial = -0.5f / (options_.filter_sigma_pixels * options_.filter_sigma_pixels),
           .range = options_.filter_range,
           .edge_slope = options_.edge_slope,
           .smooths = smooths,
           .halves = smooth_.size() > 1},
          {images.depth, images.color, &fusion_, &smooth_[0], smooth_.size() > 1 ? &smooth_[1] : &smooth_[0]});
}

FramePyramid Preprocessor::preprocess_for_fusion(const Frame& frame, const MotionAt& motion) {
  const bool has_color = !rig_.color && frame.color.size() == pixels(rig_.depth);
  gpu::Batch batch(device_);
  upload(frame, has_color, batch);
  filter(rectify(frame, motion, batch), false, batch);
  batch.submit();
  has_registered_color_ = true;
  return {.levels = {},
          .packed = {},
          .fusion = &fusion_,
          .has_color = has_color,
          .register_color_to_depth = [] {},
          .images = {}};
}

void Preprocessor::prepare_registration(const Images& images, const MotionAt& motion, bool has_color,
                                        gpu::Batch& batch) {
  has_registered_color_ = !rig_.color || !has_color;
  if (rig_.color) color_motion_ = shutter_motion(color_motion(rig_, motion), rig_.color->camera.readout);
  if (!has_registered_color_) find_nearest(*images.depth, batch);
}

std::function<const Frame&()> Preprocessor::images_at_once(const Frame& frame, const MotionAt& motion) {
  return [this, &frame, motion, global = std::make_shared<std::optional<Frame>>()]() -> const Frame& {
    if (!global_shutter_) return frame;
    if (!*global) *global = (*global_shutter_)(frame, motion);
    return **global;
  };
}

void Preprocessor::correct_fusion(FramePyramid& seen, const Frame& frame, const MotionAt& motion) {
  gpu::Batch batch(device_);
  const Images images = rectify(frame, motion, batch);
  prepare_registration(images, motion, seen.has_color, batch);
  filter(images, false, batch);
  batch.submit();
  seen.images = images_at_once(frame, motion);
}

FramePyramid Preprocessor::preprocess(const Frame& frame, const MotionAt& motion) {
  const bool has_color = frame.color.size() == pixels(rig_.color_view());
  gpu::Batch batch(device_);
  upload(frame, has_color, batch);
  const Images images = rectify(frame, motion, batch);
  prepare_registration(images, motion, has_color, batch);
  filter(images, true, batch);
  if (finest_level_ == 0) register_color_to_depth(*images.depth, batch);
  make_pyramid(batch, has_color);
  batch.submit();
  FramePyramid surface{.levels = {},
                       .packed = {},
                       .fusion = &fusion_,
                       .has_color = has_color,
                       .register_color_to_depth =
                           [this, depth = images.depth] {
                             gpu::Batch later(device_);
                             register_color_to_depth(*depth, later);
                             later.submit();
                           },
                       .images = images_at_once(frame, motion)};
  for (std::size_t level = 0; level < levels_.size(); ++level) {
    surface.levels.push_back(&levels_[level]);
    if (has_color) surface.packed.push_back(static_cast<int>(level) >= finest_level_ ? &packed_[level] : nullptr);
  }
  return surface;
}

/// Finds occluders for the color camera. `depth` without distortion; for cameras at the same position there is no
/// occlusion.
void Preprocessor::find_nearest(const gpu::Buffer& depth, gpu::Batch& batch) {
  constexpr std::uint32_t kNothing = 0x7f7fffff;  // bits of the largest float
  batch.fill(nearest_, kNothing);
  const auto width = static_cast<std::uint32_t>(rig_.depth.width),
             height = static_cast<std::uint32_t>(rig_.depth.height);
  if (!rig_.color->color_from_depth.translation().isZero())
    find_nearest_(batch, {(width + 1) / 2, (height + 1) / 2, 1},
                  {.motion = color_motion_, .width = width, .height = height}, {&depth, &nearest_});
}

/// Registers color to the fusion image, once. Points occluded from the color camera have no color.
void Preprocessor::register_color_to_depth(const gpu::Buffer& depth, gpu::Batch& batch) {
  if (has_registered_color_) return;
  has_registered_color_ = true;
  register_color_to_depth_(batch, threads(rig_.depth),
                           {.motion = color_motion_,
                            .width = static_cast<std::uint32_t>(rig_.depth.width),
                            .height = static_cast<std::uint32_t>(rig_.depth.height)},
                           {&depth, &nearest_, &raw_color_, &fusion_});
}

/// Makes the pyramid levels from the filtered depth.
void Preprocessor::make_pyramid(gpu::Batch& batch, bool has_color) {
  for (std::size_t level = 0; level < levels_.size(); ++level) {
    const Camera& c = levels_[level].camera;
    if (level > 1)
      half_(batch, threads(c),
            {.width = static_cast<std::uint32_t>(c.width),
             .height = static_cast<std::uint32_t>(c.height),
             .fine_width = static_cast<std::uint32_t>(levels_[level - 1].camera.width)},
            {&smooth_[level - 1], &smooth_[level]});
    if (static_cast<int>(level) < finest_level_) continue;
    if (has_color) make_intensity(batch, static_cast<int>(level));
    make_points_(batch, threads(c), {.camera = shader::pinhole(c), .has_color = has_color},
                 {&smooth_[level], &intensity_[level], &levels_[level].points, &packed_[level]});
  }
}

/// Makes a level's intensity from registered color, from the color camera's image, or from the finer level.
void Preprocessor::make_intensity(gpu::Batch& batch, int number) {
  const auto level = static_cast<std::size_t>(number);
  const Camera& c = levels_[level].camera;
  const auto width = static_cast<std::uint32_t>(c.width), height = static_cast<std::uint32_t>(c.height);
  const bool is_finest = number == finest_level_;  // a single step, over at most two levels
  if (is_finest && !has_registered_color_) {
    make_brightness_(batch, threads(c), {.motion = color_motion_, .width = width, .height = height},
                     {&smooth_[level], &nearest_, &raw_color_, &intensity_[level]});
    return;
  }
  make_intensity_(batch, threads(c),
                  {.width = width,
                   .height = height,
                   .fine_width = static_cast<std::uint32_t>(levels_[is_finest ? 0 : level - 1].camera.width),
                   .factor = level == 0  ? 1u
                             : is_finest ? 1u << level
                                         : 2u,
                   .from_color = is_finest},
                  {is_finest ? &fusion_ : &intensity_[level - 1], &intensity_[level]});
}

}  // namespace cairn
