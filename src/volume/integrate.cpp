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
#include "spirv/depth_min.comp.h"
#include "spirv/depth_tiles.comp.h"
#include "spirv/tsdf_integrate.comp.h"
#include "spirv/voxel_free.comp.h"

namespace cairn {
namespace {

constexpr std::uint32_t kMissingAtOnce =
    16384;  // bricks listed per pass over a frame; the rest is left to further passes
constexpr std::uint32_t kVacantAtOnce = 2048;    // slots for the device to assign per pass; most frames need fewer
constexpr std::uint32_t kFreeAtOnce = 1 << 18;   // free bricks found per pass; the rest is left to later passes
constexpr std::uint32_t kPartsAtOnce = 1 << 15;  // initial capacity for partly free bricks
constexpr std::uint32_t kFirstDownload = 1024;   // entries downloaded with the first batch; few frames have more

/// Number of blocks of 2x2 pixels.
std::uint64_t pixel_quads(const Camera& camera) {
  return (static_cast<std::uint64_t>(camera.width) + 1) / 2 * ((static_cast<std::uint64_t>(camera.height) + 1) / 2);
}

}  // namespace

/// Result of a pass over a frame.
struct Integrator::Pass {
  shader::FusionCounts counts{};
  std::vector<shader::Placement> missing;  // bricks without a slot before the pass
  std::vector<shader::Selected> selected;
  std::vector<std::uint32_t> changed;  // by entry of selected
  std::vector<shader::ivec3> free_bricks, part_bricks;
  std::vector<BrickBits> free_voxels;  // by entry of part_bricks
};

Integrator::Integrator(gpu::Device& device, const Camera& camera, const SurfaceOptions& options,
                       const SensorModel& sensor, float camera_radius)
    : device_(device),
      camera_(camera),
      options_(options),
      camera_radius_(camera_radius),
      counts_(device, sizeof(shader::FusionCounts)),
      farthest_(device, 4 * std::uint64_t{shader::tiles(camera)}),
      nearest_(device, 4 * std::uint64_t{shader::tiles(camera)}),
      quad_min_depth_(device, 4 * pixel_quads(camera)),
      vacant_(device, 4 * kVacantAtOnce),
      missing_(device, kMissingAtOnce * sizeof(shader::Placement)),
      free_bricks_(device, kFreeAtOnce * sizeof(shader::ivec3)),
      part_bricks_(device, kPartsAtOnce * sizeof(shader::ivec3)),
      free_voxels_(device, kPartsAtOnce * sizeof(BrickBits)),
      tiles_(device, "depth_tiles", depth_tiles_comp),
      mark_(device, "brick_mark", brick_mark_comp),
      place_(device, "brick_place", brick_place_comp),
      find_quad_min_depth_(device, "depth_min", depth_min_comp),
      free_(device, "brick_free", brick_free_comp),
      voxels_free_(device, "voxel_free", voxel_free_comp),
      select_(device, "brick_select", brick_select_comp),
      integrate_(device, "tsdf_integrate", tsdf_integrate_comp, shader::constants_of(sensor),
                 gpu::preferred_workgroup_size(device, 64)) {}

IntegrationResult Integrator::integrate(const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera,
                                        Volume& volume, std::uint32_t fused_count, std::uint32_t carving_interval) {
  volume.move_window(submap_from_camera.translation());
  const bool carves = fused_count % carving_interval == 1 % carving_interval;
  IntegrationResult fused;
  for (;;) {
    const Pass pass = pass_over(surface, submap_from_camera, volume, fused_count, carves);
    fused.new_bricks += static_cast<int>(pass.missing.size());
    const std::vector<Brick> waiting = volume.note_placed(pass.missing);
    if (pass.counts.waiting > 0) {  // nothing was integrated in this pass
      volume.make_resident(waiting, fused_count);
      continue;
    }
    fused.touched = static_cast<int>(pass.selected.size());
    for (std::size_t i = 0; i < pass.selected.size(); ++i)
      if (pass.changed[i] != 0) fused.changed.push_back(volume.brick_in(pass.selected[i].slot));
    fused.newly_free = mark_free(pass, submap_from_camera.translation(), volume);
    return fused;
  }
}

std::vector<Brick> Integrator::mark_free(const Pass& pass, const Eigen::Vector3d& camera, Volume& volume) const {
  BrickMarks marks = camera_radius_ > 0 ? ball(camera / static_cast<double>(volume.options().voxel_size),
                                               camera_radius_ / static_cast<double>(volume.options().voxel_size))
                                        : BrickMarks{};
  marks.bricks.insert(marks.bricks.end(), pass.free_bricks.begin(), pass.free_bricks.end());
  marks.voxels.resize(marks.bricks.size(), kAllBits);
  marks.bricks.insert(marks.bricks.end(), pass.part_bricks.begin(), pass.part_bricks.end());
  marks.voxels.insert(marks.voxels.end(), pass.free_voxels.begin(), pass.free_voxels.end());
  std::vector<Brick> newly_free = volume.mark_free(marks);
  std::sort(newly_free.begin(), newly_free.end(), before);
  newly_free.erase(std::unique(newly_free.begin(), newly_free.end()), newly_free.end());
  return newly_free;
}

/// Assigns slots to the bricks of the frame's truncation band and integrates the frame into all bricks in view; the
/// latter only if no brick waits for the host.
Integrator::Pass Integrator::pass_over(const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera,
                                       const Volume& volume, std::uint32_t fused_count, bool carves) {
  const std::vector<std::uint32_t> vacant = volume.vacant_slots(kVacantAtOnce);
  const std::uint32_t slots =
      vacant.empty() ? volume.slot_count() : std::max(volume.slot_count(), *std::ranges::max_element(vacant) + 1);
  if (selected_.size() < slots * sizeof(shader::Selected)) {
    const std::uint64_t room = std::min(2 * slots, volume.capacity());
    selected_ = gpu::Buffer(device_, room * sizeof(shader::Selected));
    changed_ = gpu::Buffer(device_, room * 4);
  }
  Pass pass;
  pass.counts.placed = pass.counts.fused = pass.counts.carved = {0, 1, 1};

  gpu::Batch batch(device_);
  batch.upload(counts_, std::span<const shader::FusionCounts>(&pass.counts, 1));
  batch.upload(vacant_, vacant);
  place_missing(batch, surface, submap_from_camera, volume, fused_count, static_cast<std::uint32_t>(vacant.size()));
  fuse(batch, surface, submap_from_camera, volume, fused_count, slots);
  if (carves) carve_free_space(batch, surface, submap_from_camera, volume);

  pass.missing.resize(kFirstDownload);
  pass.free_bricks.resize(carves ? kFirstDownload : 0);
  const auto parts = static_cast<std::uint32_t>(free_voxels_.size() / sizeof(BrickBits));
  pass.part_bricks.resize(carves ? std::min(expected_partly_free_, parts) : 0);
  pass.free_voxels.resize(pass.part_bricks.size());
  pass.selected.resize(std::min<std::size_t>(expected_selected_, changed_.size() / 4));
  pass.changed.resize(pass.selected.size());
  batch.download(counts_, std::span<shader::FusionCounts>(&pass.counts, 1));
  batch.download(missing_, pass.missing);
  batch.download(selected_, pass.selected);
  batch.download(changed_, pass.changed);
  batch.download(free_bricks_, pass.free_bricks);
  batch.download(part_bricks_, pass.part_bricks);
  batch.download(free_voxels_, pass.free_voxels);
  batch.run();
  read_rest(pass.missing, pass.counts.missing, missing_);
  read_rest(pass.free_bricks, pass.counts.free, free_bricks_);
  read_rest(pass.part_bricks, pass.counts.free_in_part, part_bricks_);
  read_rest(pass.free_voxels, pass.counts.free_in_part, free_voxels_);
  read_rest(pass.selected, pass.counts.selected, selected_);
  read_rest(pass.changed, pass.counts.selected, changed_);
  expected_selected_ = pass.counts.selected + pass.counts.selected / 4 + kFirstDownload;
  if (carves) expected_partly_free_ = pass.counts.free_in_part + pass.counts.free_in_part / 4 + kFirstDownload;
  if (pass.counts.free_in_part > parts) {  // the next carving pass finds the rest
    part_bricks_ = gpu::Buffer(device_, 2 * std::uint64_t{pass.counts.free_in_part} * sizeof(shader::ivec3));
    free_voxels_ = gpu::Buffer(device_, 2 * std::uint64_t{pass.counts.free_in_part} * sizeof(BrickBits));
  }
  return pass;
}

/// Lists the bricks needed by the frame and without a slot, and assigns vacant slots.
void Integrator::place_missing(gpu::Batch& batch, const FramePyramid& surface,
                               const Eigen::Isometry3d& submap_from_camera, const Volume& volume,
                               std::uint32_t fused_count, std::uint32_t vacant) {
  // Adjacent samples are at most half a brick apart.
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

/// Integrates the frame into the visible bricks of the first `slots` slots.
void Integrator::fuse(gpu::Batch& batch, const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera,
                      const Volume& volume, std::uint32_t fused_count, std::uint32_t slots) {
  tiles_(batch, {shader::tiles(camera_), 1, 1},
         {.width = static_cast<std::uint32_t>(camera_.width), .height = static_cast<std::uint32_t>(camera_.height)},
         {surface.fusion, &farthest_, &nearest_});
  select_(batch, {slots, 1, 1},
          {.camera = shader::pinhole(camera_),
           .submap_from_camera = shader::rigid(submap_from_camera),
           .slots = slots,
           .capacity = static_cast<std::uint32_t>(selected_.size() / sizeof(shader::Selected)),
           .fused_count = fused_count,
           .brick_size = volume.brick_size(),
           .truncation = volume.options().truncation,
           .min_depth = options_.min_depth},
          {&volume.slots(), &farthest_, &counts_, &selected_});
  batch.fill(changed_, 0);
  integrate_.indirect(batch, counts_, offsetof(shader::FusionCounts, fused),
                      {.voxels = volume.view().voxels,
                       .camera = shader::pinhole(camera_),
                       .camera_from_submap = shader::rigid(submap_from_camera.inverse()),
                       .has_color = surface.has_color,
                       .voxel_size = volume.options().voxel_size,
                       .truncation = volume.options().truncation,
                       .max_weight = volume.options().max_weight,
                       .fused_count = fused_count},
                      volume, {&selected_, &volume.slots(), surface.fusion, &changed_, &counts_});
}

/// Truncates a list to its length, or downloads the part beyond the expected length.
template <class T>
void Integrator::read_rest(std::vector<T>& list, std::uint32_t count, const gpu::Buffer& from) {
  const std::size_t expected = list.size();
  list.resize(std::min<std::size_t>(count, from.size() / sizeof(T)));
  if (list.size() <= expected) return;
  gpu::Batch batch(device_);
  batch.download(from, std::span(list).subspan(expected), expected * sizeof(T));
  batch.run();
}

/// Lists newly free bricks and voxels between the camera and the observed surfaces.
void Integrator::carve_free_space(gpu::Batch& batch, const FramePyramid& surface,
                                  const Eigen::Isometry3d& submap_from_camera, const Volume& volume) {
  Eigen::AlignedBox3d view(submap_from_camera.translation());
  for (int corner = 0; corner < 4; ++corner) {
    const Eigen::Vector2d pixel((corner & 1) != 0 ? camera_.width : 0, (corner & 2) != 0 ? camera_.height : 0);
    const Eigen::Vector3d ray((pixel.x() - camera_.cx) / camera_.fx, (pixel.y() - camera_.cy) / camera_.fy, 1.0);
    view.extend(submap_from_camera * (static_cast<double>(options_.max_depth) * ray));
  }
  const double size = volume.brick_size();
  const Brick first = (view.min() / size).array().floor().cast<int>();
  const Brick extent = (view.max() / size).array().floor().cast<int>().matrix() - first + Brick::Ones();
  const Brick clipped = extent.cwiseMin(1023);  // limit of the push constant; the window is narrower
  free_(batch, {static_cast<std::uint32_t>(clipped.x() * clipped.y()), static_cast<std::uint32_t>(clipped.z()), 1},
        {.volume = volume.view(),
         .camera = shader::pinhole(camera_),
         .camera_from_submap = shader::rigid(submap_from_camera.inverse()),
         .first = first,
         .size = static_cast<std::uint32_t>(clipped.x() | clipped.y() << 10 | clipped.z() << 20),
         .min_depth = options_.min_depth},
        {&farthest_, &nearest_, &volume.page_table(), &volume.free_marks(), &counts_, &free_bricks_, &part_bricks_});
  find_quad_min_depth_(
      batch, {static_cast<std::uint32_t>(pixel_quads(camera_)), 1, 1},
      {.width = static_cast<std::uint32_t>(camera_.width), .height = static_cast<std::uint32_t>(camera_.height)},
      {surface.fusion, &quad_min_depth_});
  voxels_free_.indirect(batch, counts_, offsetof(shader::FusionCounts, carved),
                        {.camera = shader::pinhole(camera_),
                         .camera_from_submap = shader::rigid(submap_from_camera.inverse()),
                         .bricks = static_cast<std::uint32_t>(part_bricks_.size() / sizeof(shader::ivec3)),
                         .voxel_size = volume.options().voxel_size,
                         .truncation = volume.options().truncation},
                        {&quad_min_depth_, &part_bricks_, &free_voxels_});
}

}  // namespace cairn
