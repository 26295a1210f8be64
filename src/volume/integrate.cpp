// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/integrate.hpp"

#include <algorithm>
#include <cstddef>

#include "shaders/noise.h"
#include "spirv/brick_free.comp.h"
#include "spirv/brick_mark.comp.h"
#include "spirv/brick_place.comp.h"
#include "spirv/brick_select.comp.h"
#include "spirv/depth_tiles.comp.h"
#include "spirv/tsdf_integrate.comp.h"

namespace cairn {
namespace {

constexpr std::uint32_t kMissingAtOnce =
    16384;  // bricks that a pass over a frame lists; further passes list the others
constexpr std::uint32_t kVacantAtOnce =
    2048;  // slots that the device may give to bricks; most frames have fewer new ones
constexpr std::uint32_t kFreeAtOnce = 1 << 18;  // bricks that a pass finds to be free; later passes find the others
constexpr std::uint32_t kFirstDownload = 1024;  // entries of a list that few frames fill further
constexpr std::uint32_t kLookEvery = 8;         // fused frames: neighbouring ones look through nearly the same bricks

}  // namespace

/// What one pass over a frame did.
struct Integrator::Pass {
  shader::FusionCounts counts{};
  std::vector<shader::Placement> missing;  // bricks that were not on the device; those with a slot now are
  std::vector<shader::Selected> selected;
  std::vector<std::uint32_t> changed;  // by selected brick
  std::vector<shader::ivec3> free_bricks;
};

Integrator::Integrator(gpu::Device& device, const Camera& camera, const SurfaceOptions& options,
                       const SensorModel& sensor)
    : device_(device),
      camera_(camera),
      options_(options),
      counts_(device, sizeof(shader::FusionCounts)),
      depth_tiles_(device, 4 * std::uint64_t{shader::tiles(camera)}),
      vacant_(device, 4 * kVacantAtOnce),
      missing_(device, kMissingAtOnce * sizeof(shader::Placement)),
      free_bricks_(device, kFreeAtOnce * sizeof(shader::ivec3)),
      tiles_(device, "depth_tiles", depth_tiles_comp),
      mark_(device, "brick_mark", brick_mark_comp),
      place_(device, "brick_place", brick_place_comp),
      free_(device, "brick_free", brick_free_comp),
      select_(device, "brick_select", brick_select_comp),
      integrate_(device, "tsdf_integrate", tsdf_integrate_comp, shader::constants_of(sensor),
                 gpu::threads_together(device, 64)) {}

Fused Integrator::integrate(const Surface& surface, const Eigen::Isometry3d& submap_from_camera, Volume& volume,
                            std::uint32_t fused_count) {
  volume.move_window(submap_from_camera.translation());
  Fused fused;
  for (;;) {
    const Pass pass = pass_over(surface, submap_from_camera, volume, fused_count);
    fused.new_bricks += static_cast<int>(pass.missing.size());
    const std::vector<Brick> waiting = volume.note_placed(pass.missing);
    if (pass.counts.waiting > 0) {  // nothing was fused
      volume.make_resident(waiting, fused_count);
      continue;
    }
    fused.touched = static_cast<int>(pass.selected.size());
    for (std::size_t i = 0; i < pass.selected.size(); ++i)
      if (pass.changed[i] != 0) fused.changed.push_back(volume.brick_in(pass.selected[i].slot));
    fused.newly_free.assign(pass.free_bricks.begin(), pass.free_bricks.end());
    std::sort(fused.newly_free.begin(), fused.newly_free.end(), before);
    volume.mark_free(fused.newly_free);
    return fused;
  }
}

/// Gives slots to the bricks of the frame's truncation band and fuses the frame into all bricks in view; the latter
/// only if none of them waits for the host.
Integrator::Pass Integrator::pass_over(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                                       const Volume& volume, std::uint32_t fused_count) {
  const std::vector<std::uint32_t> vacant = volume.vacant_slots(kVacantAtOnce);
  const std::uint32_t slots =
      vacant.empty() ? volume.slot_count() : std::max(volume.slot_count(), *std::ranges::max_element(vacant) + 1);
  if (selected_.size() < slots * sizeof(shader::Selected)) {
    const std::uint64_t room = std::min(2 * slots, volume.capacity());
    selected_ = gpu::Buffer(device_, room * sizeof(shader::Selected));
    changed_ = gpu::Buffer(device_, room * 4);
  }
  Pass pass;
  pass.counts.placed = pass.counts.fused = {0, 1, 1};
  const bool looks_through = fused_count % kLookEvery == 1;

  gpu::Batch batch(device_);
  batch.upload(counts_, std::span<const shader::FusionCounts>(&pass.counts, 1));
  batch.upload(vacant_, vacant);
  place_missing(batch, surface, submap_from_camera, volume, fused_count, static_cast<std::uint32_t>(vacant.size()));
  fuse(batch, surface, submap_from_camera, volume, fused_count, slots);
  if (looks_through) look_through(batch, surface, submap_from_camera, volume);

  pass.missing.resize(kFirstDownload);
  pass.free_bricks.resize(looks_through ? kFirstDownload : 0);
  pass.selected.resize(std::min<std::size_t>(usually_selected_, changed_.size() / 4));
  pass.changed.resize(pass.selected.size());
  batch.download(counts_, std::span<shader::FusionCounts>(&pass.counts, 1));
  batch.download(missing_, pass.missing);
  batch.download(selected_, pass.selected);
  batch.download(changed_, pass.changed);
  batch.download(free_bricks_, pass.free_bricks);
  batch.run();
  read_rest(pass.missing, pass.counts.missing, missing_);
  read_rest(pass.free_bricks, pass.counts.looked_through, free_bricks_);
  read_rest(pass.selected, pass.counts.selected, selected_);
  read_rest(pass.changed, pass.counts.selected, changed_);
  usually_selected_ = pass.counts.selected + pass.counts.selected / 4 + kFirstDownload;
  return pass;
}

/// Lists the bricks that the frame needs and that have no slot, and gives them the vacant ones.
void Integrator::place_missing(gpu::Batch& batch, const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                               const Volume& volume, std::uint32_t fused_count, std::uint32_t vacant) {
  // Neighbouring samples lie at most half a brick apart.
  const auto stride =
      static_cast<std::uint32_t>(std::clamp(0.5 * volume.brick_size() * camera_.fx / options_.max_depth, 1.0, 4.0));
  const auto pixels = static_cast<std::uint32_t>(camera_.width * camera_.height);
  mark_(batch, {pixels / (stride * stride), 1, 1},
        {.volume = volume.view(),
         .camera = shader::pinhole(camera_),
         .submap_from_camera = shader::rigid(submap_from_camera),
         .capacity = kMissingAtOnce,
         .vacant = vacant,
         .stride = stride,
         .phase = fused_count},
        {surface.fusion, &volume.page_table(), &counts_, &missing_, &vacant_});
  place_.indirect(batch, counts_, offsetof(shader::FusionCounts, placed),
                  {.voxels = volume.view().voxels, .count = kMissingAtOnce, .fused_count = fused_count},
                  {&missing_, &volume.page_table(), &volume.slots()});
}

/// Fuses the frame into those bricks of the first `slots` slots that are in view.
void Integrator::fuse(gpu::Batch& batch, const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                      const Volume& volume, std::uint32_t fused_count, std::uint32_t slots) {
  tiles_(batch, {shader::tiles(camera_), 1, 1},
         {.width = static_cast<std::uint32_t>(camera_.width), .height = static_cast<std::uint32_t>(camera_.height)},
         {surface.fusion, &depth_tiles_});
  select_(batch, {slots, 1, 1},
          {.camera = shader::pinhole(camera_),
           .submap_from_camera = shader::rigid(submap_from_camera),
           .slots = slots,
           .capacity = static_cast<std::uint32_t>(selected_.size() / sizeof(shader::Selected)),
           .fused_count = fused_count,
           .brick_size = volume.brick_size(),
           .truncation = volume.options().truncation,
           .min_depth = options_.min_depth},
          {&volume.slots(), &depth_tiles_, &counts_, &selected_});
  batch.fill(changed_, 0);
  integrate_.indirect(batch, counts_, offsetof(shader::FusionCounts, fused),
                      {.voxels = volume.view().voxels,
                       .camera = shader::pinhole(camera_),
                       .camera_from_submap = shader::rigid(submap_from_camera.inverse()),
                       .has_colour = surface.has_colour,
                       .voxel_size = volume.options().voxel_size,
                       .truncation = volume.options().truncation,
                       .max_weight = volume.options().max_weight,
                       .fused_count = fused_count},
                      volume, {&selected_, &volume.slots(), surface.fusion, &changed_, &counts_});
}

/// Cuts a list to its length, or downloads what is longer than expected.
template <class T>
void Integrator::read_rest(std::vector<T>& list, std::uint32_t count, const gpu::Buffer& from) {
  const std::size_t expected = list.size();
  list.resize(std::min<std::size_t>(count, from.size() / sizeof(T)));
  if (list.size() <= expected) return;
  gpu::Batch batch(device_);
  batch.download(from, std::span(list).subspan(expected), expected * sizeof(T));
  batch.run();
}

/// Lists the bricks in front of what the frame sees that have no voxels and were not known to be free.
void Integrator::look_through(gpu::Batch& batch, const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
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
  free_(batch, {static_cast<std::uint32_t>(clipped.x() * clipped.y()), static_cast<std::uint32_t>(clipped.z()), 1},
        {.volume = volume.view(),
         .camera = shader::pinhole(camera_),
         .camera_from_submap = shader::rigid(submap_from_camera.inverse()),
         .first = first,
         .size = static_cast<std::uint32_t>(clipped.x() | clipped.y() << 10 | clipped.z() << 20),
         .capacity = kFreeAtOnce},
        {surface.fusion, &volume.page_table(), &volume.free_marks(), &counts_, &free_bricks_});
}

}  // namespace cairn
