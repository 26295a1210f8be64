// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "surface/preprocess.hpp"

#include "spirv/surface_filter.comp.h"
#include "spirv/surface_half.comp.h"
#include "spirv/surface_intensity.comp.h"
#include "spirv/surface_normals.comp.h"
#include "spirv/surface_pack.comp.h"
#include "spirv/surface_rectify.comp.h"

namespace cairn {
namespace {

std::uint32_t pixels(const Camera& camera) { return static_cast<std::uint32_t>(camera.width * camera.height); }

}  // namespace

Preprocessor::Preprocessor(gpu::Device& device, const Camera& camera, const SurfaceOptions& options, int levels,
                           int finest_level)
    : device_(device),
      source_camera_(camera),
      options_(options),
      finest_level_(finest_level),
      raw_depth_(device, 4 * std::uint64_t{pixels(camera)}),
      raw_colour_(device, 4 * std::uint64_t{pixels(camera)}),
      depth_(device, camera.distorted() ? 4 * std::uint64_t{pixels(camera)} : 4),
      colour_(device, camera.distorted() ? 4 * std::uint64_t{pixels(camera)} : 4),
      fusion_(device, 8 * std::uint64_t{pixels(camera)}),
      rectify_(device, "surface_rectify", surface_rectify_comp),
      filter_(device, "surface_filter", surface_filter_comp),
      half_(device, "surface_half", surface_half_comp),
      normals_(device, "surface_normals", surface_normals_comp),
      make_intensity_(device, "surface_intensity", surface_intensity_comp),
      pack_(device, "surface_pack", surface_pack_comp) {
  Camera rectified = camera;
  rectified.distortion = {};
  for (int level = 0; level < levels; ++level) {
    const Camera c = rectified.at_level(level);
    levels_.push_back({c, gpu::Buffer(device, 8 * std::uint64_t{pixels(c)})});
    smooth_.emplace_back(device, 4 * std::uint64_t{pixels(c)});
    const bool is_used = level >= finest_level;
    intensity_.emplace_back(device, is_used ? 4 * std::uint64_t{pixels(c)} : 4);
    packed_.emplace_back(device, is_used ? 8 * std::uint64_t{pixels(c)} : 8);
  }
}

Surface Preprocessor::preprocess(const Frame& frame) {
  const std::uint32_t n = pixels(source_camera_);
  const bool has_colour = !frame.colour.empty();
  const bool distorted = source_camera_.distorted();
  gpu::Batch batch(device_);
  batch.upload(raw_depth_, frame.depth);
  if (has_colour) batch.upload(raw_colour_, frame.colour);
  if (distorted) {
    const auto d = [&](std::size_t i) { return static_cast<float>(source_camera_.distortion[i]); };
    rectify_(batch, {n, 1, 1},
             {.camera = shader::pinhole(levels_[0].camera),
              .k1 = d(0),
              .k2 = d(1),
              .p1 = d(2),
              .p2 = d(3),
              .k3 = d(4),
              .has_colour = has_colour},
             {&raw_depth_, &raw_colour_, &depth_, &colour_});
  }
  filter_(
      batch,
      {(static_cast<std::uint32_t>(source_camera_.width) + 3) / 4 * static_cast<std::uint32_t>(source_camera_.height),
       1, 1},
      {.width = static_cast<std::uint32_t>(source_camera_.width),
       .height = static_cast<std::uint32_t>(source_camera_.height),
       .min_depth = options_.min_depth,
       .max_depth = options_.max_depth,
       .spatial = -0.5f / (options_.filter_sigma_pixels * options_.filter_sigma_pixels),
       .range = options_.filter_range,
       .edge_slope = options_.edge_slope},
      {distorted ? &depth_ : &raw_depth_, distorted ? &colour_ : &raw_colour_, &fusion_, &smooth_[0]});
  make_pyramid(batch, has_colour);
  batch.run();
  Surface surface{.levels = {}, .packed = {}, .fusion = &fusion_, .has_colour = has_colour};
  for (std::size_t level = 0; level < levels_.size(); ++level) {
    surface.levels.push_back(&levels_[level]);
    if (has_colour) surface.packed.push_back(static_cast<int>(level) >= finest_level_ ? &packed_[level] : nullptr);
  }
  return surface;
}

/// From smooth_[0] and fusion_ to all that is asked of the levels.
void Preprocessor::make_pyramid(gpu::Batch& batch, bool has_colour) {
  for (std::size_t level = 0; level < levels_.size(); ++level) {
    const Camera& c = levels_[level].camera;
    if (level > 0)
      half_(batch, {pixels(c), 1, 1},
            {.width = static_cast<std::uint32_t>(c.width),
             .height = static_cast<std::uint32_t>(c.height),
             .fine_width = static_cast<std::uint32_t>(levels_[level - 1].camera.width)},
            {&smooth_[level - 1], &smooth_[level]});
    if (static_cast<int>(level) < finest_level_) continue;
    normals_(batch, {pixels(c), 1, 1}, {.camera = shader::pinhole(c)}, {&smooth_[level], &levels_[level].points});
    if (!has_colour) continue;
    const bool from_colour = static_cast<int>(level) == finest_level_;  // in one step, two levels are the most
    const auto width = static_cast<std::uint32_t>(c.width), height = static_cast<std::uint32_t>(c.height);
    make_intensity_(batch, {pixels(c), 1, 1},
                    {.width = width,
                     .height = height,
                     .fine_width = static_cast<std::uint32_t>(levels_[from_colour ? 0 : level - 1].camera.width),
                     .factor = level == 0    ? 1u
                               : from_colour ? 1u << level
                                             : 2u,
                     .from_colour = from_colour},
                    {from_colour ? &fusion_ : &intensity_[level - 1], &intensity_[level]});
    pack_(batch, {pixels(c), 1, 1}, {.width = width, .height = height},
          {&intensity_[level], &levels_[level].points, &packed_[level]});
  }
}

}  // namespace cairn
