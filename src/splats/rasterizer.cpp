// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/rasterizer.hpp"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <string>

#include "spirv/splat_backward.comp.h"
#include "spirv/splat_color.comp.h"
#include "spirv/splat_count.comp.h"
#include "spirv/splat_entries.comp.h"
#include "spirv/splat_forward.comp.h"
#include "spirv/splat_gradient.comp.h"
#include "spirv/splat_project.comp.h"
#include "spirv/splat_ranges.comp.h"

namespace cairn {
namespace {

constexpr std::uint32_t kDepthBits = 24;  // of shader::kNoSplatKey

gpu::Buffer words(gpu::Device& device, std::uint64_t count) { return {device, 4 * std::max<std::uint64_t>(1, count)}; }

}  // namespace

SplatRasterizer::SplatRasterizer(gpu::Device& device)
    : device_(device),
      sort_(device),
      project_(device, "splat_project", splat_project_comp),
      color_(device, "splat_color", splat_color_comp),
      gradient_(device, "splat_gradient", splat_gradient_comp),
      count_(device, "splat_count", splat_count_comp),
      list_entries_(device, "splat_entries", splat_entries_comp),
      ranges_kernel_(device, "splat_ranges", splat_ranges_comp),
      forward_(device, "splat_forward", splat_forward_comp),
      backward_(device, "splat_backward", splat_backward_comp),
      visible_count_(words(device, 1)),
      entry_count_(words(device, 1)) {}

void SplatRasterizer::reserve_splats(const SplatModel& model) {
  sort_.reserve(model.count);
  const std::uint64_t harmonics = 3 * harmonics_per_splat(static_cast<int>(model.degree)) * model.count;
  if (!harmonic_gradients_ || harmonic_gradients_.size() < 4 * harmonics) {
    device_.wait();
    harmonic_gradients_ = words(device_, harmonics);
  }
  if (capacity_ > 0 && model.count <= capacity_) return;
  device_.wait();  // earlier batches may use the old buffers
  capacity_ = std::max(1u, model.count);
  for (RadixSort::Pairs* pairs : {&pairs_, &scratch_})
    *pairs = {.keys = words(device_, capacity_), .values = words(device_, capacity_)};
  projected_ = gpu::Buffer(device_, sizeof(shader::ProjectedSplat) * std::uint64_t{capacity_});
  tiles_of_ = words(device_, 2 * std::uint64_t{capacity_});
  offsets_ = words(device_, capacity_);
  ranks_ = words(device_, capacity_);
  gradients_ = words(device_, std::uint64_t{shader::kSplatPlanes} * capacity_);
  reset_motion(capacity_);
}

void SplatRasterizer::reset_motion(std::uint32_t count) {
  device_.wait();
  if (!motion_ || motion_.size() < 8 * std::uint64_t{count}) motion_ = words(device_, 2 * std::uint64_t{count});
  gpu::Batch batch(device_);
  batch.fill(motion_, 0);
  batch.run();
}

std::uint32_t SplatRasterizer::max_entries() const {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(device_.max_binding() / (4 * std::uint64_t{shader::kSplatSlot}), device_.max_texels()));
}

void SplatRasterizer::reserve_entries(std::uint32_t entries) {
  if (entries > max_entries())
    throw std::runtime_error(std::to_string(visible_) + " splats cover " + std::to_string(entries) +
                             " tiles of an image, and the device's limit is " + std::to_string(max_entries()) +
                             ": use fewer SplatOptions::max_splats, or a smaller SplatOptions::resolution");
  sort_.reserve(entries);
  if (entry_capacity_ > 0 && entries <= entry_capacity_) return;
  device_.wait();
  entry_capacity_ = std::min(entries + entries / 4 + 1, max_entries());
  for (RadixSort::Pairs* pairs : {&entry_pairs_, &entry_scratch_})
    *pairs = {.keys = words(device_, entry_capacity_), .values = words(device_, entry_capacity_)};
  owners_ = words(device_, entry_capacity_);
  splats_ = words(device_, entry_capacity_);
  for (gpu::Buffer* slots : {&slot_shapes_, &slot_colors_})
    *slots = words(device_, std::uint64_t{shader::kSplatSlot} * entry_capacity_);
}

shader::SplatViewPush SplatRasterizer::view_push(const SplatModel& model) const {
  return {.camera = shader::pinhole(view_.camera),
          .camera_from_world = shader::rigid(view_.world_from_camera.inverse()),
          .count = model.count,
          .visible = visible_,
          .degree = model.degree,
          .low_pass = view_.low_pass,
          .entries = entries_};
}

shader::SplatImagePush SplatRasterizer::image_push() const {
  return {.width = static_cast<std::uint32_t>(view_.camera.width),
          .height = static_cast<std::uint32_t>(view_.camera.height),
          .columns = columns_,
          .tiles = tiles_};
}

void SplatRasterizer::forward(const SplatModel& model, const SplatView& view) {
  view_ = view;
  const auto width = static_cast<std::uint32_t>(view.camera.width),
             height = static_cast<std::uint32_t>(view.camera.height);
  columns_ = (width + shader::kSplatTile - 1) / shader::kSplatTile;
  tiles_ = columns_ * ((height + shader::kSplatTile - 1) / shader::kSplatTile);
  reserve_splats(model);
  if (const std::uint64_t image = std::uint64_t{shader::kSplatImages} * width * height;
      !image_ || image_.size() != 4 * image || ranges_.size() != 8 * std::uint64_t{tiles_}) {
    device_.wait();
    image_ = words(device_, image);
    ranges_ = words(device_, 2 * std::uint64_t{tiles_});
  }
  gpu::Batch batch(device_);
  project_(batch, {model.count, 1, 1}, view_push(model),
           {&model.core, &projected_, &tiles_of_, &pairs_.keys, &pairs_.values});
  sort_.sort(batch, pairs_, scratch_, model.count, kDepthBits);
  batch.fill(visible_count_, 0);
  count_(batch, {model.count, 1, 1}, {.count = model.count, .columns = columns_},
         {&pairs_.keys, &pairs_.values, &tiles_of_, &offsets_, &visible_count_, &projected_, &ranks_});
  std::vector<std::uint32_t> visible(1), entries(1);
  sort_.scan(batch, offsets_, model.count, entry_count_);
  batch.download(entry_count_, entries);
  batch.download(visible_count_, visible);
  batch.run();
  visible_ = visible[0];
  entries_ = entries[0];
  reserve_entries(entries_);
  color_(batch, {visible_, 1, 1}, view_push(model), {&pairs_.values, &model.core, &model.harmonics, &projected_});
  list_entries_(
      batch, {visible_, 1, 1}, {.count = visible_, .columns = columns_},
      {&pairs_.values, &tiles_of_, &offsets_, &entry_pairs_.keys, &entry_pairs_.values, &owners_, &projected_});
  sort_.sort(batch, entry_pairs_, entry_scratch_, entries_, static_cast<std::uint32_t>(std::bit_width(tiles_ - 1)));
  batch.fill(ranges_, 0);
  ranges_kernel_(batch, {entries_, 1, 1}, {.count = entries_, .columns = columns_},
                 {&entry_pairs_.keys, &entry_pairs_.values, &owners_, &ranges_, &splats_});
  forward_(batch, {tiles_, 1, 1}, image_push(), {&projected_, &splats_, &ranges_, &image_});
  batch.submit();
}

void SplatRasterizer::backward(const SplatModel& model, const gpu::Buffer& pixels) {
  gpu::Batch batch(device_);
  // Slots behind a tile's last effective splat have no gradient.
  for (const gpu::Buffer* slots : {&slot_shapes_, &slot_colors_})
    batch.fill(*slots, 0, 0, 4 * std::max<std::uint64_t>(1, std::uint64_t{shader::kSplatSlot} * entries_));
  backward_(batch, {tiles_, 1, 1}, image_push(),
            {&projected_, &splats_, &entry_pairs_.values, &ranges_, &image_, &pixels, &slot_shapes_, &slot_colors_});
  gradient_(batch, {visible_, 1, 1}, view_push(model),
            {&pairs_.values, &model.core, &model.harmonics, &projected_, &offsets_, &slot_shapes_, &slot_colors_,
             &gradients_, &harmonic_gradients_, &motion_});
  batch.submit();
}

SplatImage SplatRasterizer::download_image() {
  const std::size_t pixels = image_.size() / (4 * shader::kSplatImages);
  std::vector<float> planes(shader::kSplatImages * pixels);
  gpu::Batch batch(device_);
  batch.download(image_, planes);
  batch.run();
  SplatImage image;
  for (std::size_t i = 0; i < pixels; ++i) {
    image.color.emplace_back(planes[i], planes[pixels + i], planes[2 * pixels + i]);
    image.opacity.push_back(planes[3 * pixels + i]);
    image.depth.push_back(planes[4 * pixels + i]);
  }
  return image;
}

}  // namespace cairn
