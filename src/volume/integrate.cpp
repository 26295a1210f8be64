// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/integrate.hpp"

#include <algorithm>

#include "spirv/brick_mark.comp.h"
#include "spirv/brick_select.comp.h"
#include "spirv/depth_tiles.comp.h"
#include "spirv/tsdf_integrate.comp.h"

namespace cairn {
namespace {

constexpr std::uint32_t kMaxNewBricks = 65536;  // of one frame; what is left over comes with the next
constexpr std::uint32_t kFirstDownload = 4096;  // most frames have fewer

}  // namespace

Integrate::Integrate(gpu::Device& device, const Camera& camera, const SurfaceOptions& options)
    : device_(device),
      camera_(camera),
      options_(options),
      depth_tiles_(device, 4 * std::uint64_t{shader::tiles(camera)}),
      new_count_(device, 4),
      new_bricks_(device, kMaxNewBricks * sizeof(shader::ivec3)),
      selected_count_(device, 4),
      tiles_(device, "depth_tiles", depth_tiles_comp),
      mark_(device, "brick_mark", brick_mark_comp),
      select_(device, "brick_select", brick_select_comp),
      integrate_(device, "tsdf_integrate", tsdf_integrate_comp) {}

Fused Integrate::operator()(const Surface& surface, const Eigen::Isometry3d& submap_from_camera, Volume& volume,
                            std::uint32_t stamp) {
  volume.move_window(submap_from_camera.translation());
  const auto pixels = static_cast<std::uint32_t>(camera_.width * camera_.height);
  const shader::Pinhole pinhole = shader::pinhole(camera_);
  const shader::Rigid pose = shader::rigid(submap_from_camera);

  std::uint32_t new_count[1] = {0};
  std::vector<shader::ivec3> marked(kFirstDownload);
  gpu::Batch batch(device_);
  batch.fill(new_count_, 0);
  // Neighbouring samples lie at most half a brick apart.
  const auto stride =
      static_cast<std::uint32_t>(std::clamp(0.5 * volume.brick_size() * camera_.fx / options_.max_depth, 1.0, 4.0));
  mark_(batch, {pixels / (stride * stride), 1, 1},
        {.volume = volume.view(),
         .camera = pinhole,
         .submap_from_camera = pose,
         .capacity = kMaxNewBricks,
         .stride = stride,
         .phase = stamp},
        {surface.fusion, &volume.page_table(), &new_count_, &new_bricks_});
  batch.download(new_count_, std::span<std::uint32_t>(new_count));
  batch.download(new_bricks_, marked);
  batch.run();
  const std::uint32_t count = std::min(new_count[0], kMaxNewBricks);
  if (count > kFirstDownload) {
    marked.resize(count);
    batch.download(new_bricks_, marked);
    batch.run();
  }
  const std::vector<Brick> bricks(marked.begin(), marked.begin() + count);
  volume.make_resident(bricks, stamp);

  if (selected_.size() < 4 * std::uint64_t{volume.slot_count()})
    selected_ = gpu::Buffer(device_, 4 * std::uint64_t{std::min(2 * volume.slot_count(), volume.capacity())});
  std::uint32_t selected_count[1] = {0};
  batch.fill(selected_count_, 0);
  tiles_(batch, {shader::tiles(camera_), 1, 1},
         {.width = static_cast<std::uint32_t>(camera_.width), .height = static_cast<std::uint32_t>(camera_.height)},
         {surface.fusion, &depth_tiles_});
  select_(batch, {volume.slot_count(), 1, 1},
          {.camera = pinhole,
           .submap_from_camera = pose,
           .slots = volume.slot_count(),
           .capacity = static_cast<std::uint32_t>(selected_.size() / 4),
           .stamp = stamp,
           .brick_size = volume.brick_size(),
           .truncation = volume.options().truncation,
           .min_depth = options_.min_depth},
          {&volume.slots(), &depth_tiles_, &selected_count_, &selected_});
  batch.download(selected_count_, std::span<std::uint32_t>(selected_count));
  batch.run();

  integrate_(batch, {64 * selected_count[0], 1, 1},
             {.voxels = volume.view().voxels,
              .camera = pinhole,
              .camera_from_submap = shader::rigid(submap_from_camera.inverse()),
              .count = selected_count[0],
              .has_colour = surface.has_colour,
              .voxel_size = volume.options().voxel_size,
              .truncation = volume.options().truncation,
              .max_weight = volume.options().max_weight},
             {&selected_, &volume.slots(), surface.fusion});
  batch.run();
  return {.touched = static_cast<int>(selected_count[0]), .new_bricks = static_cast<int>(count)};
}

}  // namespace cairn
