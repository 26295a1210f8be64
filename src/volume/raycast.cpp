// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/raycast.hpp"

#include <bit>

#include "spirv/raycast.comp.h"
#include "spirv/raycast_range.comp.h"
#include "spirv/view_half.comp.h"

namespace cairn {
Raycaster::Raycaster(gpu::Device& device, const Camera& camera, const SurfaceOptions& options, int levels,
                     int finest_level)
    : device_(device),
      options_(options),
      finest_(finest_level),
      nearest_(device, 4 * std::uint64_t{shader::tiles(camera.at_level(finest_level))}),
      farthest_(device, 4 * std::uint64_t{shader::tiles(camera.at_level(finest_level))}),
      range_(device, "raycast_range", raycast_range_comp),
      raycast_(device, "raycast", raycast_comp),
      half_(device, "view_half", view_half_comp) {
  for (int level = finest_level; level < levels; ++level) {
    const Camera c = camera.at_level(level);
    levels_.push_back({c, gpu::Buffer(device, std::uint64_t{8} * static_cast<std::uint64_t>(c.width * c.height))});
  }
}

SurfacePrediction Raycaster::raycast(const Volume& volume, const Eigen::Isometry3d& submap_from_camera) {
  const shader::Pinhole camera = shader::pinhole(levels_[0].camera);
  const shader::Rigid pose = shader::rigid(submap_from_camera);
  gpu::Batch batch(device_);
  batch.fill(nearest_, std::bit_cast<std::uint32_t>(1e9f));
  batch.fill(farthest_, 0);
  range_(batch, {volume.slot_count(), 1, 1},
         {.camera = camera,
          .submap_from_camera = pose,
          .slots = volume.slot_count(),
          .brick_size = volume.brick_size(),
          .min_depth = 0.5f * options_.min_depth,
          .max_depth = 2 * options_.max_depth},
         {&volume.slots(), &nearest_, &farthest_});
  raycast_(batch, {camera.width, camera.height, 1},
           {.volume = volume.view(), .camera = camera, .submap_from_camera = pose}, volume,
           {&volume.page_table(), &nearest_, &farthest_, &levels_[0].points});
  halve(batch);
  batch.submit();
  return view_from(submap_from_camera);
}

void Raycaster::halve(gpu::Batch& batch) {
  for (std::size_t i = 1; i < levels_.size(); ++i) {
    const Camera& c = levels_[i].camera;
    half_(batch, {static_cast<std::uint32_t>(c.width), static_cast<std::uint32_t>(c.height), 1},
          {.width = static_cast<std::uint32_t>(c.width),
           .height = static_cast<std::uint32_t>(c.height),
           .fine_width = static_cast<std::uint32_t>(levels_[i - 1].camera.width)},
          {&levels_[i - 1].points, &levels_[i].points});
  }
}

SurfacePrediction Raycaster::view_from(const Eigen::Isometry3d& submap_from_camera) const {
  SurfacePrediction view{.submap_from_camera = submap_from_camera,
                         .levels = std::vector<const VertexNormalMap*>(static_cast<std::size_t>(finest_), nullptr)};
  for (const auto& level : levels_) view.levels.push_back(&level);
  return view;
}

Raycaster::SavedState Raycaster::save(const SurfacePrediction& view) const {
  SavedState saved{.submap_from_camera = view.submap_from_camera, .points = {}};
  if (view.levels.empty()) return saved;
  saved.points.resize(levels_[0].points.size() / 4);
  gpu::Batch batch(device_);
  batch.download(levels_[0].points, std::span(saved.points));
  batch.run();
  return saved;
}

SurfacePrediction Raycaster::restore(const SavedState& saved) {
  if (saved.points.size() * 4 != levels_[0].points.size()) return {};
  gpu::Batch batch(device_);
  batch.upload(levels_[0].points, saved.points);
  halve(batch);
  batch.submit();
  return view_from(saved.submap_from_camera);
}

}  // namespace cairn
