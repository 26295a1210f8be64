// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/esdf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

#include "options/option_ranges.hpp"
#include "spirv/esdf_check.comp.h"
#include "spirv/esdf_distance.comp.h"
#include "spirv/esdf_finalize.comp.h"
#include "spirv/esdf_lines.comp.h"
#include "spirv/esdf_lower.comp.h"
#include "spirv/esdf_nearest.comp.h"
#include "spirv/esdf_raise.comp.h"
#include "spirv/esdf_seed.comp.h"
#include "spirv/esdf_sites.comp.h"

namespace cairn {
namespace {

constexpr float kTolerance = 0.25f;             // voxels; see EsdfSitesPush
constexpr float kMaxGap = 0.8f;                 // meters
constexpr float kMinFreeRadius = 1.75f;         // voxels; a ball of this radius contains all of the voxel of its center
constexpr double kMinBallSpacing = 0.25;        // voxels of the TSDF
constexpr std::uint32_t kFirstCapacity = 256;   // blocks: 12 MiB
constexpr std::uint32_t kSteps = 24;            // wave steps before the host checks the counter; even
constexpr std::uint32_t kMaxTableBits = 8;      // 256 blocks per side
constexpr std::uint64_t kVoxelsOfASite = 100;   // voxels reached by a wave per site; with more sites a rebuild is
                                                // cheaper
constexpr std::uint64_t kMaxCells = 1 << 25;    // per box of a rebuild: 256 MiB
constexpr std::uint64_t kStackCells = 1 << 20;  // 16 MiB
constexpr std::size_t kJobsAtOnce = 4096;       // bricks uploaded from the host at once: 16 MiB
constexpr std::size_t kBlocksAtOnce = 1024;     // blocks of distances downloaded at once: 16 MiB

constexpr shader::EsdfCount kEmptyCount{.groups = 0, .one_y = 1, .one_z = 1, .count = 0};

/// Specialization constants: kFieldInTexels of shaders/esdf.h and kPoolInTexels of shaders/pool.h.
std::array<float, 5> constants(bool in_texels) {
  const float value = in_texels ? 1.0f : 0.0f;
  return {value, 0, 0, 0, value};
}

float voxel_size_for(const FuseOptions& fuse, const EsdfOptions& options) {
  return options.voxel_size > 0 ? options.voxel_size : 2 * fuse.voxel_size;
}

}  // namespace

int esdf_scale(const FuseOptions& fuse, const EsdfOptions& options) {
  const auto check = [](const char* name, float value) {
    if (const AllowedRange range = range_of(name); !range.has(value))
      throw std::runtime_error(
          fmt::format("option {} is {}, allowed is {}", name, value, words_of(range, Unit::meters)));
  };
  check("esdf.voxel_size", options.voxel_size);
  check("esdf.max_distance", options.max_distance);
  check("esdf.robot_radius", options.robot_radius);
  const float wanted = voxel_size_for(fuse, options) / fuse.voxel_size;
  for (const int scale : {1, 2, 4, 8})
    if (std::abs(wanted - static_cast<float>(scale)) < 1e-3f * static_cast<float>(scale)) return scale;
  throw std::runtime_error("EsdfOptions::voxel_size is " + std::to_string(voxel_size_for(fuse, options)) +
                           " m: choose 1, 2, 4 or 8 times the map's " + std::to_string(fuse.voxel_size) + " m");
}

float free_radius(const FuseOptions& fuse, const EsdfOptions& options) {
  return options.robot_radius > 0 ? std::max(options.robot_radius, kMinFreeRadius * voxel_size_for(fuse, options))
                                  : 0.0f;
}

Esdf::Kernels::Kernels(gpu::Device& device, bool texels)
    : in_texels(texels),
      sites(device, "esdf_sites", esdf_sites_comp, constants(texels)),
      check(device, "esdf_check", esdf_check_comp, constants(texels)),
      raise(device, "esdf_raise", esdf_raise_comp, constants(texels)),
      finalize(device, "esdf_finalize", esdf_finalize_comp, constants(texels)),
      lower(device, "esdf_lower", esdf_lower_comp, constants(texels)),
      distance(device, "esdf_distance", esdf_distance_comp, constants(texels)),
      seed(device, "esdf_seed", esdf_seed_comp, constants(texels)),
      nearest(device, "esdf_nearest", esdf_nearest_comp, constants(texels)),
      lines(device, "esdf_lines", esdf_lines_comp, constants(texels)) {}

Esdf::Esdf(gpu::Device& device, const FuseOptions& fuse, const EsdfOptions& options, std::uint64_t max_texels)
    : device_(device),
      fuse_(fuse),
      options_(options),
      scale_(esdf_scale(fuse, options)),
      voxel_size_(static_cast<float>(scale_) * fuse.voxel_size),
      max_texels_(max_texels != 0 ? std::min(max_texels, device.max_texels()) : device.max_texels()),
      counts_(device, (kSteps + 1) * sizeof(shader::EsdfCount)),
      removed_(device, 4) {}

/// Switches to reading by address when the field exceeds the device's texel limit.
void Esdf::choose_kernels(bool is_volume_in_texels) {
  const std::uint64_t max_voxels =
      std::max(capacity_ * std::uint64_t{shader::kEsdfVoxels}, std::uint64_t{list_capacity_});
  const bool in_texels = max_voxels <= max_texels_ && is_volume_in_texels;
  if (!kernels_ || kernels_->in_texels != in_texels) kernels_.emplace(device_, in_texels);
}

/// Buffer to bind as texels; any buffer if the kernel does not read texels.
const gpu::Buffer* Esdf::texels(const gpu::Buffer& buffer) const { return kernels_->in_texels ? &buffer : &counts_; }

shader::EsdfView Esdf::view() const {
  const float reach = options_.max_distance / voxel_size_;
  return {.nearest = shader::address(nearest_),
          .surface = shader::address(surface_),
          .blocks = shader::address(blocks_),
          .table = shader::address(table_),
          .counts = shader::address(counts_),
          .table_bits = table_bits_,
          .max_squared = reach * reach,
          .max_groups = device_.max_groups()};
}

Esdf::Updated Esdf::update(const Volume& volume, std::span<const Brick> changed) {
  return update(changed, &volume, volume.host(), nullptr);
}

Esdf::Updated Esdf::update(const BrickTree& map, std::span<const Brick> changed, const BrickTree* also_free) {
  return update(changed, nullptr, map, also_free);
}

Esdf::Updated Esdf::update(std::span<const Brick> changed, const Volume* volume, const BrickTree& map,
                           const BrickTree* also_free) {
  std::vector<shader::EsdfJob> here, elsewhere;               // voxels on the device; voxels on the host or missing
  std::vector<const std::uint64_t*> voxels;                   // host voxels by entry of `elsewhere`
  std::vector<Brick> bricks(changed.begin(), changed.end());  // unique: two threads would race for the same sites
  std::sort(bricks.begin(), bricks.end(), before);
  bricks.erase(std::unique(bricks.begin(), bricks.end()), bricks.end());
  std::vector<BrickBits> free{kNoBits, kAllBits};  // shader::kNoneFree, shader::kAllFree, then partly free bricks
  for (const Brick& brick : bricks) {
    BrickBits bits = map.free_voxels(brick);
    const BrickBits more = also_free != nullptr ? also_free->free_voxels(brick) : kNoBits;
    for (std::size_t w = 0; w < bits.size(); ++w) bits[w] |= more[w];
    std::uint32_t bits_at = bits == kNoBits ? shader::kNoneFree : shader::kAllFree;
    if (bits != kNoBits && bits != kAllBits) {
      bits_at = static_cast<std::uint32_t>(free.size());
      free.push_back(bits);
    }
    const std::uint32_t slot = volume != nullptr ? volume->slot_of(brick) : Volume::kNoSlot;
    if (slot != Volume::kNoSlot) {
      here.push_back({.brick = brick, .slot = slot, .free = bits_at});
      continue;
    }
    elsewhere.push_back({.brick = brick, .slot = Volume::kNoSlot, .free = bits_at});
    voxels.push_back(map.find(brick));
    if (voxels.back() != nullptr) elsewhere.back().slot = 0;
  }
  reserve(here);
  reserve(elsewhere);
  if (slot_of_.empty()) return {};
  choose_kernels(volume == nullptr || volume->is_read_as_texels());

  if (free_.size() < free.size() * sizeof(BrickBits)) free_ = gpu::Buffer(device_, 2 * free.size() * sizeof(BrickBits));
  gpu::Batch batch(device_);
  batch.upload(free_, free);
  batch.upload(counts_, std::vector<shader::EsdfCount>(kSteps + 1, kEmptyCount));
  batch.fill(removed_, 0);
  if (!here.empty()) find_sites(batch, here, volume->voxels());
  for (std::size_t begin = 0; begin < elsewhere.size(); begin += kJobsAtOnce) {
    batch.submit();  // no buffer may grow while in use
    const auto jobs = std::span(elsewhere).subspan(begin, std::min(kJobsAtOnce, elsewhere.size() - begin));
    if (voxels_.size() < jobs.size() * sizeof(BrickVoxels))
      voxels_ = gpu::Buffer(device_, jobs.size() * sizeof(BrickVoxels));
    std::uint32_t slot = 0;
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      if (voxels[begin + i] == nullptr) continue;
      batch.upload(voxels_, std::span(voxels[begin + i], 512), slot * sizeof(BrickVoxels));
      jobs[i].slot = slot++;
    }
    find_sites(batch, jobs, voxels_);
  }
  return propagate(batch, false);
}

void Esdf::find_sites(gpu::Batch& batch, std::span<const shader::EsdfJob> jobs, const gpu::Buffer& voxels) {
  if (jobs_.size() < jobs.size_bytes()) jobs_ = gpu::Buffer(device_, 2 * jobs.size_bytes());
  const auto side = static_cast<std::uint32_t>(8 / scale_);
  const auto count = static_cast<std::uint32_t>(jobs.size());
  batch.upload(jobs_, jobs);
  kernels_->sites(batch, {(count * side * side * side + 7) / 8, 1, 1},
                  {.field = view(),
                   .voxels = shader::address(voxels),
                   .jobs = count,
                   .scale_bits = static_cast<std::uint32_t>(std::countr_zero(static_cast<unsigned>(scale_))),
                   .min_weight = fuse_.min_mesh_weight,
                   .slope = fuse_.voxel_size / fuse_.truncation,
                   .tolerance = kTolerance,
                   .capacity = list_capacity_},
                  {&jobs_, &list_[0], &dirty_, &removed_, texels(surface_), texels(table_), texels(voxels), &free_});
}

/// Allocates blocks for observed bricks and the gaps between them, since a wave may have to cross unknown space. A
/// block is omitted if it fits into a cube of kMaxGap without observed blocks (a morphological closing).
void Esdf::reserve(std::span<const shader::EsdfJob> jobs) {
  const int bricks = 2 * scale_;  // TSDF bricks per side of a block
  const int reach = std::max(1, static_cast<int>(std::lround(kMaxGap / 2 / (shader::kEsdfSide * voxel_size_))));
  std::vector<Brick> around;
  for (int x = -reach; x <= reach; ++x)
    for (int y = -reach; y <= reach; ++y)
      for (int z = -reach; z <= reach; ++z) around.emplace_back(x, y, z);
  std::vector<Block> wanted;
  for (const shader::EsdfJob& job : jobs) {
    if (job.slot == Volume::kNoSlot && job.free == shader::kNoneFree) continue;
    const Block block = cell_of(job.brick, bricks);
    if (!observed_.insert(block).second) continue;
    for (const Brick& offset : around) {
      const Block near = block + offset;
      if (!near_.insert(near).second) continue;
      for (const Brick& outer : around) {
        int& unobserved = unobserved_around_.try_emplace(near + outer, static_cast<int>(around.size())).first->second;
        if (--unobserved > 0) continue;
        wanted.push_back(near + outer);
        box_.extend(near + outer);
      }
    }
  }
  std::sort(wanted.begin(), wanted.end(), before);
  if (!wanted.empty()) allocate(wanted);
}

void Esdf::allocate(const std::vector<Block>& blocks) {
  const int extent = box_.sizes().maxCoeff() + 3;  // margin, so that neighbor lookups do not wrap around the table
  std::uint32_t bits = std::max(5u, table_bits_);
  while (extent > 1 << bits) ++bits;
  if (bits > kMaxTableBits ||
      box_.min().cwiseAbs().cwiseMax(box_.max().cwiseAbs()).maxCoeff() >= static_cast<int>(shader::kEsdfReach))
    throw std::runtime_error("the distance field would be wider than " +
                             std::to_string((1 << kMaxTableBits) * static_cast<int>(shader::kEsdfSide)) +
                             " voxels: raise EsdfOptions::voxel_size");
  const std::size_t first = block_of_.size();
  for (const Block& block : blocks) {
    slot_of_.emplace(block, static_cast<std::uint32_t>(block_of_.size()));
    block_of_.push_back(block);
  }
  const auto needed = static_cast<std::uint32_t>(block_of_.size());
  if (needed > capacity_) resize(std::max({kFirstCapacity, needed, 2 * capacity_}));  // first: for a complete map

  gpu::Batch batch(device_);
  std::size_t begin = first;
  if (bits != table_bits_) {
    table_bits_ = bits;
    table_ = gpu::Buffer(device_, std::uint64_t{4} << (3 * bits));
    batch.fill(table_, 0);
    begin = 0;
  }
  const auto mask = (1 << bits) - 1;
  std::vector<std::uint32_t> packed;
  for (std::size_t slot = begin; slot < block_of_.size(); ++slot) {
    const Block& b = block_of_[slot];
    const auto at = static_cast<std::uint64_t>(((((b.z() & mask) << bits) | (b.y() & mask)) << bits) | (b.x() & mask));
    batch.fill(table_, static_cast<std::uint32_t>(slot + 1), 4 * at, 4);
  }
  constexpr auto kReach = static_cast<int>(shader::kEsdfReach);
  for (std::size_t slot = first; slot < block_of_.size(); ++slot) {
    const Block b = block_of_[slot] + Block::Constant(kReach);
    packed.push_back(static_cast<std::uint32_t>(b.x() | b.y() << 10 | b.z() << 20));
  }
  batch.upload(blocks_, packed, 4 * first);
  const std::uint64_t voxels = packed.size() * std::uint64_t{shader::kEsdfVoxels};
  batch.fill(nearest_, 0xffffffffu, first * std::uint64_t{shader::kEsdfVoxels} * 8, voxels * 8);
  batch.fill(surface_, 0, first * std::uint64_t{shader::kEsdfVoxels} * 4, voxels * 4);
  batch.submit();
}

void Esdf::resize(std::uint32_t capacity) {
  const std::uint64_t voxels = std::uint64_t{capacity} * shader::kEsdfVoxels;
  gpu::Batch batch(device_);
  const auto grow = [&](gpu::Buffer& buffer, std::uint64_t bytes) {
    gpu::Buffer larger(device_, bytes);
    batch.fill(larger, 0);
    if (buffer) batch.copy(buffer, larger);
    batch.submit();
    buffer = std::move(larger);
  };
  grow(nearest_, 8 * voxels);
  grow(surface_, 4 * voxels);
  grow(blocks_, 4 * std::uint64_t{capacity});
  grow(dirty_, 4 * std::uint64_t{capacity});
  check_list_ = gpu::Buffer(device_, 4 * std::uint64_t{capacity});
  const std::uint64_t wanted = std::min(voxels / 2, device_.max_binding() / sizeof(shader::EsdfEntry));
  resize_lists(std::max(list_capacity_, static_cast<std::uint32_t>(wanted)));
  capacity_ = capacity;
}

/// Lists are empty between updates. A list overflow causes a rebuild.
void Esdf::resize_lists(std::uint32_t capacity) {
  list_capacity_ = capacity;
  for (gpu::Buffer& list : list_) list = gpu::Buffer(device_, list_capacity_ * sizeof(shader::EsdfEntry));
}

Esdf::Updated Esdf::rebuild() {
  if (slot_of_.empty()) return {};
  gpu::Batch batch(device_);
  return propagate(batch, true);
}

/// Recomputes all distances with the separable transform (Felzenszwalb & Huttenlocher 2012) in boxes along the longest
/// axis; twice as fast as waves. Returns false if a box would be too large.
bool Esdf::transform(Updated& updated) {
  if (!kernels_->in_texels) return false;
  const Eigen::Vector3i low = static_cast<int>(shader::kEsdfSide) * box_.min(),
                        high = static_cast<int>(shader::kEsdfSide) * (box_.max() + Block::Ones());
  const Eigen::Vector3i size = high - low;
  const std::uint64_t max_voxels = std::min(kMaxCells, max_texels_);
  int axis = 0;
  size.maxCoeff(&axis);
  const int reach = static_cast<int>(std::ceil(options_.max_distance / voxel_size_)) + 2;
  const auto layer = size.cast<std::uint64_t>().prod() / static_cast<std::uint64_t>(size[axis]);
  const auto layers = static_cast<int>(std::min(max_voxels / layer, static_cast<std::uint64_t>(size[axis])));
  const int step = layers == size[axis] ? layers : layers - 2 * reach;
  if (step < std::min(reach, size[axis])) return false;

  const gpu::Buffer cells[2] = {{device_, 4 * layer * static_cast<std::uint64_t>(layers)},
                                {device_, 4 * layer * static_cast<std::uint64_t>(layers)}};
  const auto largest_layer = size.cast<std::uint64_t>().prod() / static_cast<std::uint64_t>(size.minCoeff());
  const gpu::Buffer stack(device_, sizeof(shader::Parabola) * std::max(kStackCells, largest_layer));
  for (int at = low[axis]; at < high[axis]; at += step) {
    Eigen::AlignedBox3i target(low, high), box(low, high);
    target.min()[axis] = at, target.max()[axis] = std::min(at + step, high[axis]);
    box.min()[axis] = std::max(at - reach, low[axis]), box.max()[axis] = std::min(at + step + reach, high[axis]);
    transform(box, target, cells, stack);
  }
  gpu::Batch batch(device_);
  batch.fill(dirty_, 1, 0, 4 * block_of_.size());
  return run_waves(batch, updated);
}

/// Transforms the voxels of `target`; sites outside `box` are too far away to matter. Upper corners are exclusive.
void Esdf::transform(const Eigen::AlignedBox3i& box, const Eigen::AlignedBox3i& target, const gpu::Buffer (&cells)[2],
                     const gpu::Buffer& stack) {
  std::vector<std::uint32_t> blocks;
  for (std::size_t slot = 0; slot < block_of_.size(); ++slot) {
    const Eigen::Vector3i corner = static_cast<int>(shader::kEsdfSide) * block_of_[slot];
    const Eigen::Vector3i end = corner.array() + static_cast<int>(shader::kEsdfSide);
    if ((corner.array() < box.max().array()).all() && (end.array() > box.min().array()).all())
      blocks.push_back(static_cast<std::uint32_t>(slot));
  }
  const Eigen::Vector3i size = box.sizes();
  const auto count = static_cast<std::uint32_t>(blocks.size());
  const shader::EsdfBoxPush push{.field = view(),
                                 .first = box.min(),
                                 .size = size,
                                 .low = target.min(),
                                 .high = target.max(),
                                 .blocks = count,
                                 .capacity = list_capacity_};
  gpu::Batch batch(device_);
  batch.upload(check_list_, blocks);
  batch.fill(cells[0], shader::kNoSite);
  kernels_->seed(batch, {64 * count, 1, 1}, push, {&check_list_, &cells[0], &surface_, &blocks_});
  for (const int axis : {2, 1, 0}) {
    const gpu::Buffer &from = cells[axis & 1], &to = cells[1 - (axis & 1)];
    const int across = axis == 2 ? size.y() : size.z(), rows = axis == 0 ? size.y() : size.x();
    const auto row_cells = static_cast<std::uint64_t>(across) * static_cast<std::uint64_t>(size[axis]);
    const int rows_per_dispatch = static_cast<int>(std::clamp<std::uint64_t>(kStackCells / row_cells, 1, 65535));
    for (int row = 0; row < rows; row += rows_per_dispatch) {
      const auto some = static_cast<std::uint32_t>(std::min(rows_per_dispatch, rows - row));
      kernels_->lines(batch, {static_cast<std::uint32_t>(across), some, 1},
                      {.field = view(),
                       .first = box.min(),
                       .size = size,
                       .axis = static_cast<std::uint32_t>(axis),
                       .row = static_cast<std::uint32_t>(row),
                       .rows = some},
                      {&from, &to, &stack, &surface_, &blocks_});
    }
  }
  kernels_->nearest(batch, {64 * count, 1, 1}, push, {&check_list_, &list_[0], &cells[1], &surface_, &blocks_});
  batch.run();
}

/// Propagates the changed sites in the list to distances.
Esdf::Updated Esdf::propagate(gpu::Batch& batch, bool restart) {
  Updated updated;
  std::vector<shader::EsdfCount> counts(kSteps + 1, kEmptyCount);
  std::uint32_t removed[1] = {0};
  if (!restart) {
    batch.download(counts_, std::span(counts).first(1));
    batch.download(removed_, std::span<std::uint32_t>(removed));
    batch.run();
    updated.sites = static_cast<int>(counts[0].count);
    const std::uint64_t voxels = block_of_.size() * std::uint64_t{shader::kEsdfVoxels};
    restart = counts[0].count > list_capacity_ || 2 * (block_of_.size() - propagated_) > block_of_.size() ||
              kVoxelsOfASite * std::uint64_t{counts[0].count} > voxels;
  }
  updated.rebuilt = restart;
  if (restart) {  // start with an empty list
    counts[0] = kEmptyCount;
    batch.upload(counts_, counts);
    batch.run();
    if (transform(updated)) {
      propagated_ = block_of_.size();
      return updated;
    }
    batch.upload(counts_, counts);
  }
  std::vector<std::uint32_t> blocks;
  for (std::size_t slot = restart || removed[0] != 0 ? 0 : propagated_; slot < block_of_.size(); ++slot)
    blocks.push_back(static_cast<std::uint32_t>(slot) << shader::kBlockFlags |
                     (restart               ? shader::kBlockRestart
                      : slot >= propagated_ ? shader::kBlockIsNew
                                            : 0u));
  propagated_ = block_of_.size();
  if (blocks.empty() && updated.sites == 0) return updated;
  batch.upload(check_list_, blocks);
  const auto count = static_cast<std::uint32_t>(blocks.size());
  kernels_->check(batch, {64 * count, 1, 1}, {.field = view(), .capacity = list_capacity_, .blocks = count},
                  {&check_list_, &list_[0], texels(nearest_), texels(surface_), texels(blocks_)});
  const shader::EsdfWavePush first{
      .field = view(), .list = shader::address(list_[0]), .step = 0, .capacity = list_capacity_};
  if (!restart)
    kernels_->raise.indirect(batch, counts_, 0, first,
                             {texels(list_[0]), texels(nearest_), texels(surface_), texels(blocks_), texels(table_)});
  kernels_->finalize.indirect(batch, counts_, 0, first, {&list_[0], &dirty_, texels(nearest_)});
  if (run_waves(batch, updated)) return updated;
  if (restart) {  // many small fragments of surface make wide waves
    resize_lists(2 * list_capacity_);
    choose_kernels(kernels_->in_texels);
  }
  Updated again = rebuild();
  again.sites = updated.sites;
  return again;
}

/// Runs waves until no distance decreases. Returns false if a list was too small.
bool Esdf::run_waves(gpu::Batch& batch, Updated& updated) {
  std::vector<shader::EsdfCount> counts(kSteps + 1);
  while (true) {
    for (std::uint32_t step = 0; step < kSteps; ++step) {
      // Finalizing each step makes the result independent of the thread order. Between frames it would cost a tenth of
      // the time, and that field is not written to a file.
      const gpu::Buffer &now = list_[step & 1], &next = list_[(step + 1) & 1];
      kernels_->lower.indirect(
          batch, counts_, step * sizeof(shader::EsdfCount),
          {.field = view(),
           .list = shader::address(now),
           .step = step,
           .capacity = list_capacity_,
           .is_final = updated.rebuilt},
          {texels(now), &next, &dirty_, texels(nearest_), texels(surface_), texels(blocks_), texels(table_), &dirty_});
      if (updated.rebuilt)
        kernels_->finalize.indirect(
            batch, counts_, (step + 1) * sizeof(shader::EsdfCount),
            {.field = view(), .list = shader::address(next), .step = step + 1, .capacity = list_capacity_},
            {&next, &dirty_, texels(nearest_)});
    }
    batch.download(counts_, counts);
    batch.run();
    for (const auto& c : counts) {
      if (c.count > list_capacity_) return false;
      updated.voxels += static_cast<int>(c.count);
      updated.steps += c.count > 0;
    }
    if (counts[kSteps].count == 0) return true;
    updated.voxels -= static_cast<int>(counts[kSteps].count), --updated.steps;  // counted again in the next round
    counts[0] = counts[kSteps];
    std::fill(counts.begin() + 1, counts.end(), kEmptyCount);
    batch.upload(counts_, counts);
  }
}

std::shared_ptr<const DistanceField> distances_of(gpu::Device& device, const BrickTree& map, const FuseOptions& fuse,
                                                  const EsdfOptions& options, const Trajectory& visited,
                                                  const std::optional<BrickBox>& box) {
  const auto voxel = static_cast<double>(fuse.voxel_size), radius = static_cast<double>(free_radius(fuse, options));
  BrickTree around;
  std::optional<Eigen::Vector3d> last;
  for (const StampedPose& pose : visited) {
    if (radius == 0) break;
    const Eigen::Vector3d center = pose.world_from_camera.translation() / voxel;
    if (last && (center - *last).norm() < kMinBallSpacing) continue;
    last = center;
    const BrickMarks marks = ball(center, radius / voxel);
    for (std::size_t i = 0; i < marks.bricks.size(); ++i)
      if (!box || box->contains(marks.bricks[i])) around.mark_free(marks.bricks[i], marks.voxels[i]);
  }
  std::vector<Brick> all = map.bricks();
  for (const std::vector<Brick>& free : {map.free_bricks(), around.free_bricks()})
    all.insert(all.end(), free.begin(), free.end());
  Esdf esdf(device, fuse, options);
  esdf.update(map, all, &around);
  return esdf.field();
}

std::shared_ptr<const DistanceField> Esdf::field() {
  const float offset = 0.5f * static_cast<float>(scale_ - 1) * fuse_.voxel_size;
  std::vector<std::uint32_t> dirty(block_of_.size());
  if (!dirty.empty()) {
    gpu::Batch batch(device_);
    batch.download(dirty_, dirty);
    batch.fill(dirty_, 0);
    batch.run();
  }
  samples_.resize(block_of_.size());
  std::vector<std::uint32_t> slots;
  for (std::uint32_t slot = 0; slot < block_of_.size(); ++slot)
    if (dirty[slot] != 0) slots.push_back(slot);
  if (!slots.empty() && !distances_) distances_ = gpu::Buffer(device_, kBlocksAtOnce * sizeof(DistanceField::Block));
  for (std::size_t begin = 0; begin < slots.size(); begin += kBlocksAtOnce) {
    const auto some = std::span(slots).subspan(begin, std::min(kBlocksAtOnce, slots.size() - begin));
    const auto count = static_cast<std::uint32_t>(some.size());
    std::vector<DistanceField::Block> distances(some.size());
    gpu::Batch batch(device_);
    batch.upload(check_list_, std::span<const std::uint32_t>(some));
    kernels_->distance(
        batch, {64 * count, 1, 1},
        {.field = view(), .voxel_size = voxel_size_, .max_distance = options_.max_distance, .blocks = count},
        {&check_list_, &distances_, texels(nearest_), texels(surface_), texels(blocks_)});
    batch.download(distances_, distances);
    batch.run();
    for (std::size_t i = 0; i < some.size(); ++i) {
      const bool is_observed =
          std::any_of(distances[i].begin(), distances[i].end(), [](float d) { return !std::isnan(d); });
      samples_[some[i]] = is_observed ? std::make_shared<const DistanceField::Block>(distances[i]) : nullptr;
    }
  }
  DistanceField::Blocks blocks;
  for (std::size_t slot = 0; slot < samples_.size(); ++slot)
    if (samples_[slot]) blocks.push_back({block_of_[slot], samples_[slot]});
  return std::make_shared<const DistanceField>(voxel_size_, Eigen::Vector3f::Constant(offset), options_.max_distance,
                                               std::move(blocks));
}

}  // namespace cairn
