// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/integrate.hpp"

#include <algorithm>

#include "shaders/noise.h"
#include "spirv/brick_free.comp.h"
#include "spirv/brick_mark.comp.h"
#include "spirv/brick_select.comp.h"
#include "spirv/depth_tiles.comp.h"
#include "spirv/tsdf_integrate.comp.h"

namespace cairn {
namespace {

constexpr std::uint32_t kNewAtOnce = 16384;     // bricks that a pass over a frame lists; further passes list the others
constexpr std::uint32_t kFreeAtOnce = 1 << 18;  // the same of those that it looks through
constexpr std::uint32_t kFirstDownload = 4096;  // most frames have fewer new ones
constexpr std::uint32_t kLookEvery = 4;         // fused frames: neighbouring ones look through nearly the same bricks

/// The bricks that a kernel lists. `append` records it; what finds no place in the list it leaves for another pass.
/// Which bricks a full list holds depends on the order of the threads, and so all are taken before one gets its slot.
template <class Append>
std::vector<Brick> collect(gpu::Batch& batch, const gpu::Buffer& count, const gpu::Buffer& list, const Append& append) {
  const std::size_t capacity = list.size() / sizeof(shader::ivec3);
  std::vector<Brick> bricks;
  std::uint32_t listed[1] = {0};
  do {
    std::vector<shader::ivec3> some(kFirstDownload);
    batch.fill(count, 0);
    append();
    batch.download(count, std::span<std::uint32_t>(listed));
    batch.download(list, some);
    batch.run();
    some.resize(std::min<std::size_t>(listed[0], capacity));
    if (some.size() > kFirstDownload) {
      batch.download(list, some);
      batch.run();
    }
    bricks.insert(bricks.end(), some.begin(), some.end());
  } while (listed[0] > capacity);
  return bricks;
}

}  // namespace

Integrator::Integrator(gpu::Device& device, const Camera& camera, const SurfaceOptions& options,
                       const SensorModel& sensor)
    : device_(device),
      camera_(camera),
      options_(options),
      depth_tiles_(device, 4 * std::uint64_t{shader::tiles(camera)}),
      new_count_(device, 4),
      new_bricks_(device, kNewAtOnce * sizeof(shader::ivec3)),
      free_count_(device, 4),
      free_bricks_(device, kFreeAtOnce * sizeof(shader::ivec3)),
      selected_count_(device, 4),
      tiles_(device, "depth_tiles", depth_tiles_comp),
      mark_(device, "brick_mark", brick_mark_comp),
      free_(device, "brick_free", brick_free_comp),
      select_(device, "brick_select", brick_select_comp),
      integrate_(device, "tsdf_integrate", tsdf_integrate_comp, shader::constants_of(sensor)) {}

Fused Integrator::integrate(const Surface& surface, const Eigen::Isometry3d& submap_from_camera, Volume& volume,
                            std::uint32_t fused_count) {
  volume.move_window(submap_from_camera.translation());
  const std::vector<Brick> missing = find_missing(surface, submap_from_camera, volume, fused_count);
  volume.make_resident(missing, fused_count);
  if (volume.slot_count() == 0) return {};  // nothing was ever seen
  const std::uint32_t count = select(surface, submap_from_camera, volume, fused_count);
  Fused fused = fuse(surface, submap_from_camera, volume, fused_count, count);
  fused.new_bricks = static_cast<int>(missing.size());
  if (fused_count % kLookEvery == 1) {
    fused.newly_free = look_through(surface, submap_from_camera, volume);
    volume.mark_free(fused.newly_free);
  }
  return fused;
}

/// The bricks of the frame's truncation band that have no slot.
std::vector<Brick> Integrator::find_missing(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                                            const Volume& volume, std::uint32_t fused_count) {
  const auto pixels = static_cast<std::uint32_t>(camera_.width * camera_.height);
  // Neighbouring samples lie at most half a brick apart.
  const auto stride =
      static_cast<std::uint32_t>(std::clamp(0.5 * volume.brick_size() * camera_.fx / options_.max_depth, 1.0, 4.0));
  gpu::Batch batch(device_);
  return collect(batch, new_count_, new_bricks_, [&] {
    mark_(batch, {pixels / (stride * stride), 1, 1},
          {.volume = volume.view(),
           .camera = shader::pinhole(camera_),
           .submap_from_camera = shader::rigid(submap_from_camera),
           .capacity = kNewAtOnce,
           .stride = stride,
           .phase = fused_count},
          {surface.fusion, &volume.page_table(), &new_count_, &new_bricks_});
  });
}

/// Lists the slots of the bricks in view in selected_; returns how many.
std::uint32_t Integrator::select(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                                 const Volume& volume, std::uint32_t fused_count) {
  if (selected_.size() < 4 * std::uint64_t{volume.slot_count()})
    selected_ = gpu::Buffer(device_, 4 * std::uint64_t{std::min(2 * volume.slot_count(), volume.capacity())});
  std::uint32_t count[1] = {0};
  gpu::Batch batch(device_);
  batch.fill(selected_count_, 0);
  tiles_(batch, {shader::tiles(camera_), 1, 1},
         {.width = static_cast<std::uint32_t>(camera_.width), .height = static_cast<std::uint32_t>(camera_.height)},
         {surface.fusion, &depth_tiles_});
  select_(batch, {volume.slot_count(), 1, 1},
          {.camera = shader::pinhole(camera_),
           .submap_from_camera = shader::rigid(submap_from_camera),
           .slots = volume.slot_count(),
           .capacity = static_cast<std::uint32_t>(selected_.size() / 4),
           .fused_count = fused_count,
           .brick_size = volume.brick_size(),
           .truncation = volume.options().truncation,
           .min_depth = options_.min_depth},
          {&volume.slots(), &depth_tiles_, &selected_count_, &selected_});
  batch.download(selected_count_, std::span<std::uint32_t>(count));
  batch.run();
  return count[0];
}

/// Fuses the frame into the first `count` slots of selected_.
Fused Integrator::fuse(const Surface& surface, const Eigen::Isometry3d& submap_from_camera, const Volume& volume,
                       std::uint32_t fused_count, std::uint32_t count) {
  if (changed_.size() < selected_.size()) changed_ = gpu::Buffer(device_, selected_.size());
  gpu::Batch batch(device_);
  batch.fill(changed_, 0);
  integrate_(batch, {64 * count, 1, 1},
             {.voxels = volume.view().voxels,
              .camera = shader::pinhole(camera_),
              .camera_from_submap = shader::rigid(submap_from_camera.inverse()),
              .count = count,
              .has_colour = surface.has_colour,
              .voxel_size = volume.options().voxel_size,
              .truncation = volume.options().truncation,
              .max_weight = volume.options().max_weight,
              .fused_count = fused_count},
             volume, {&selected_, &volume.slots(), surface.fusion, &changed_});
  std::vector<std::uint32_t> slots(count), changed(count);
  batch.download(selected_, slots);
  batch.download(changed_, changed);
  batch.run();
  Fused fused{.touched = static_cast<int>(count), .changed = {}};
  for (std::size_t i = 0; i < slots.size(); ++i)
    if (changed[i] != 0) fused.changed.push_back(volume.brick_in(slots[i]));
  return fused;
}

/// The bricks in front of what the frame sees that have no voxels and were not known to be free.
std::vector<Brick> Integrator::look_through(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                                            const Volume& volume) {
  Eigen::AlignedBox3d view(submap_from_camera.translation());
  for (int corner = 0; corner < 4; ++corner) {
    const Eigen::Vector2d pixel((corner & 1) != 0 ? camera_.width : 0, (corner & 2) != 0 ? camera_.height : 0);
    const Eigen::Vector3d ray((pixel.x() - camera_.cx) / camera_.fx, (pixel.y() - camera_.cy) / camera_.fy, 1.0);
    view.extend(submap_from_camera * (static_cast<double>(options_.max_depth) * ray));
  }
  const double size = volume.brick_size();
  const Brick first = (view.min() / size).array().floor().cast<int>();
  const Brick extent = (view.max() / size).array().floor().cast<int>().matrix() - first + Brick::Ones();
  const Brick clipped = extent.cwiseMin(1023);  // what the push holds; the window is narrower
  gpu::Batch batch(device_);
  std::vector<Brick> bricks = collect(batch, free_count_, free_bricks_, [&] {
    free_(batch, {static_cast<std::uint32_t>(clipped.x() * clipped.y()), static_cast<std::uint32_t>(clipped.z()), 1},
          {.volume = volume.view(),
           .camera = shader::pinhole(camera_),
           .camera_from_submap = shader::rigid(submap_from_camera.inverse()),
           .first = first,
           .size = static_cast<std::uint32_t>(clipped.x() | clipped.y() << 10 | clipped.z() << 20),
           .capacity = kFreeAtOnce},
          {surface.fusion, &volume.page_table(), &volume.free_marks(), &free_count_, &free_bricks_});
  });
  std::sort(bricks.begin(), bricks.end(), before);
  return bricks;
}

}  // namespace cairn
