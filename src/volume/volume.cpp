// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/volume.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <unordered_set>

#include "spirv/brick_place.comp.h"

namespace cairn {
namespace {

constexpr std::uint64_t kBrickBytes = sizeof(BrickVoxels);
constexpr std::uint32_t kMinBricks = 2048;                       // 8 MiB; the minimum for a view of a room
constexpr std::uint64_t kMaxBricks = std::uint64_t{1} << 23;     // 32 GiB
constexpr std::uint32_t kMaxTableBits = 8;                       // 256 bricks per side: 64 MiB of page table
constexpr std::size_t kBricksPerCopy = 4096;                     // 16 MiB of staging memory
constexpr std::uint64_t kDefaultLimit = std::uint64_t{2} << 30;  // bytes
constexpr std::uint64_t kCpuLimit = std::uint64_t{1} << 30;      // bytes; the limit for reading as texels

std::uint32_t table_bits_for(float reach, float brick_size) {
  std::uint32_t bits = 5;
  while (bits < kMaxTableBits && static_cast<float>(1u << bits) * brick_size < 2 * reach) ++bits;
  return bits;
}

std::uint32_t capacity_for(const gpu::Device& device, const FuseOptions& options, std::uint64_t table_bytes) {
  const std::uint64_t default_budget = device.info().type == "cpu" ? kCpuLimit : kDefaultLimit;
  const std::uint64_t budget =
      options.device_memory != 0 ? options.device_memory : std::min(device.info().memory / 2, default_budget);
  const std::uint64_t per_brick = kBrickBytes + sizeof(shader::SlotState);
  const std::uint64_t needed = table_bytes + kMinBricks * per_brick;
  if (budget < needed)
    throw std::runtime_error("FuseOptions::device_memory of " + std::to_string(budget >> 20) +
                             " MiB is too little: at least " + std::to_string((needed >> 20) + 1) +
                             " MiB are needed at this voxel size");
  // The voxels are a single buffer, and voxel indices have 32 bits.
  return static_cast<std::uint32_t>(std::min({(budget - table_bytes) / per_brick, device.max_allocation() / kBrickBytes,
                                              device.max_binding() / sizeof(shader::SlotState), kMaxBricks}));
}

}  // namespace

Volume::Volume(gpu::Device& device, const FuseOptions& options, float reach)
    : device_(device),
      options_(options),
      table_bits_(table_bits_for(reach, 8 * options.voxel_size)),
      capacity_(capacity_for(device, options, std::uint64_t{4} << (3 * table_bits_))),
      voxels_(device, capacity_ * kBrickBytes),
      page_table_(device, std::uint64_t{4} << (3 * table_bits_)),
      free_marks_(device, (std::uint64_t{1} << (3 * table_bits_)) / 8),
      slots_(device, capacity_ * sizeof(shader::SlotState)),
      place_(device, "brick_place", brick_place_comp),
      marks_(free_marks_.size() / 4, 0) {
  gpu::Batch batch(device_);
  batch.fill(page_table_, 0);
  batch.fill(free_marks_, 0);
  batch.fill(slots_, 0);
  batch.submit();
  origin_ = Brick::Constant(-(1 << (table_bits_ - 1)));
}

shader::VolumeView Volume::view() const {
  return {.voxels = shader::address(voxels_),
          .origin = origin_,
          .table_bits = table_bits_,
          .voxel_size = options_.voxel_size,
          .truncation = options_.truncation};
}

bool Volume::in_window(const Brick& brick) const { return in_window(brick, origin_); }

bool Volume::in_window(const Brick& brick, const Brick& origin) const {
  const Brick relative = brick - origin;
  return (relative.array() >= 0).all() && (relative.array() < (1 << table_bits_)).all();
}

std::uint32_t Volume::table_index(const Brick& brick) const {
  const int mask = (1 << table_bits_) - 1;
  return static_cast<std::uint32_t>(((((brick.z() & mask) << table_bits_) | (brick.y() & mask)) << table_bits_) |
                                    (brick.x() & mask));
}

std::uint32_t Volume::slot_of(const Brick& brick) const {
  const auto found = slot_of_.find(brick);
  return found == slot_of_.end() ? kNoSlot : found->second;
}

void Volume::move_window(const Eigen::Vector3d& center) {
  constexpr int kWindowStep = 8;  // bricks; ignores smaller moves
  const Brick middle =
      (center / (8.0 * options_.voxel_size * kWindowStep)).array().round().cast<int>().matrix() * kWindowStep;
  const Brick origin = middle - Brick::Constant(1 << (table_bits_ - 1)), before = origin_;
  if (origin == before) return;
  origin_ = origin;
  std::vector<std::uint32_t> leaving;
  for (const auto& [brick, slot] : slot_of_)
    if (!in_window(brick)) leaving.push_back(slot);
  std::sort(leaving.begin(), leaving.end());
  evict(leaving);
  refresh_window(before);
}

void Volume::move_window_to(std::span<const Brick> bricks) {
  if (std::all_of(bricks.begin(), bricks.end(), [&](const Brick& brick) { return in_window(brick); })) return;
  BrickBox box;
  for (const Brick& brick : bricks) box.extend(brick);
  const Eigen::Vector3d low = box.min().cast<double>(), high = (box.max() + Brick::Ones()).cast<double>();
  move_window((low + high) / 2 * static_cast<double>(brick_size()));
}

/// Updates the device's knowledge of bricks outside the pool, free marks and host entries, for a window moved from
/// `origin_before`.
void Volume::refresh_window(const std::optional<Brick>& origin_before) {
  marks_.assign(free_marks_.size() / 4, 0);
  host_.visit_free([&](const Brick& brick, const BrickBits& free) {
    if (in_window(brick) && free == kAllBits) marks_[table_index(brick) / 32] |= 1u << (table_index(brick) % 32);
  });
  std::vector<shader::Placement> removed, added;
  host_.visit([&](const Brick& brick) {
    const bool was_in = origin_before && in_window(brick, *origin_before), is_in = in_window(brick);
    if (was_in == is_in || slot_of_.contains(brick)) return;
    (is_in ? added : removed)
        .push_back({.brick = brick,
                    .slot = shader::kNoSlot,
                    .table_index = table_index(brick),
                    .entry = is_in ? shader::kOnHost : 0});
  });
  gpu::Batch batch(device_);
  batch.upload(free_marks_, marks_);
  for (const auto& placements : {removed, added}) {  // in this order, because they may share table entries
    place(batch, placements, 0);
    batch.submit();
  }
}

std::uint32_t Volume::entry_without_slot(const Brick& brick) const {
  return in_window(brick) && host_.find(brick) != nullptr ? shader::kOnHost : 0;
}

std::vector<std::uint32_t> Volume::vacant_slots(std::uint32_t max_count) const {
  std::vector<std::uint32_t> slots(
      vacant_.rbegin(),
      vacant_.rbegin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(max_count, vacant_.size())));
  for (std::uint32_t slot = high_slot_; slots.size() < max_count && slot < capacity_; ++slot) slots.push_back(slot);
  return slots;
}

std::vector<Brick> Volume::note_placed(std::span<const shader::Placement> placements) {
  std::vector<Brick> waiting;
  std::unordered_set<std::uint32_t> taken;
  const std::uint32_t high_before = high_slot_;
  for (const auto& p : placements) {
    const Brick brick(p.brick);
    if (p.slot == shader::kNoSlot) {
      waiting.push_back(brick);
      continue;
    }
    slot_of_.emplace(brick, p.slot);
    taken.insert(p.slot);
    high_slot_ = std::max(high_slot_, p.slot + 1);
    brick_in_.resize(std::max<std::size_t>(brick_in_.size(), high_slot_));
    brick_in_[p.slot] = brick;
    ++counts_.allocated;
  }
  if (taken.empty()) return waiting;
  for (std::uint32_t slot = high_before; slot < high_slot_; ++slot) vacant_.push_back(slot);
  std::erase_if(vacant_, [&](std::uint32_t slot) { return taken.contains(slot); });
  std::sort(vacant_.begin(), vacant_.end(), std::greater<>());
  return waiting;
}

std::vector<Brick> Volume::mark_free(const BrickMarks& marks) {
  std::vector<Brick> newly_free;
  bool is_marked = false;
  for (std::size_t i = 0; i < marks.bricks.size(); ++i) {
    const Brick& brick = marks.bricks[i];
    if (!host_.mark_free(brick, marks.voxels[i])) continue;
    newly_free.push_back(brick);
    if (!in_window(brick) || host_.free_voxels(brick) != kAllBits) continue;
    marks_[table_index(brick) / 32] |= 1u << (table_index(brick) % 32);
    is_marked = true;
  }
  if (is_marked) {
    gpu::Batch batch(device_);
    batch.upload(free_marks_, marks_);
    batch.submit();
  }
  return newly_free;
}

/// Downloads the voxels of slots, at most kBricksPerCopy at a time.
void Volume::read(std::span<const std::uint32_t> slots, std::span<BrickVoxels> voxels) {
  for (std::size_t begin = 0; begin < slots.size(); begin += kBricksPerCopy) {
    const std::size_t all = std::min(begin + kBricksPerCopy, slots.size());
    gpu::Batch batch(device_);
    for (std::size_t i = begin; i < all;) {  // a copy per run of consecutive slots
      std::size_t end = i + 1;
      while (end < all && slots[end] == slots[end - 1] + 1) ++end;
      batch.download(voxels_, voxels.subspan(i, end - i), slots[i] * kBrickBytes);
      i = end;
    }
    batch.run();
  }
}

void Volume::copy_to(BrickTree& tree, std::span<const std::uint32_t> slots) {
  std::vector<BrickVoxels> voxels;
  for (std::size_t begin = 0; begin < slots.size(); begin += kBricksPerCopy) {
    const auto some = slots.subspan(begin, std::min(kBricksPerCopy, slots.size() - begin));
    voxels.resize(some.size());
    read(some, voxels);
    for (std::size_t i = 0; i < some.size(); ++i) tree.put(brick_in_[some[i]], voxels[i]);
  }
}

std::vector<shader::SlotState> Volume::slot_states() {
  std::vector<shader::SlotState> states(high_slot_);
  gpu::Batch batch(device_);
  batch.download(slots_, states);
  batch.run();
  return states;
}

void Volume::evict(std::span<const std::uint32_t> slots) {
  if (slots.empty()) return;
  copy_to(host_, slots);
  const auto states = slot_states();
  for (const std::uint32_t slot : slots) last_seen_[Brick(states[slot].brick)] = states[slot].last_seen;
  vacate(slots);
  counts_.paged_out += slots.size();
}

/// Frees these slots and removes their bricks from the page table.
void Volume::vacate(std::span<const std::uint32_t> slots) {
  const std::unordered_set<std::uint32_t> removed(slots.begin(), slots.end());
  std::vector<shader::Placement> placements;
  for (auto it = slot_of_.begin(); it != slot_of_.end();) {
    if (removed.contains(it->second)) {
      placements.push_back({.brick = it->first,
                            .slot = it->second,
                            .table_index = table_index(it->first),
                            .entry = entry_without_slot(it->first)});
      it = slot_of_.erase(it);
    } else {
      ++it;
    }
  }
  gpu::Batch batch(device_);
  place(batch, placements, 0);
  batch.submit();
  vacant_.insert(vacant_.end(), slots.begin(), slots.end());
  std::sort(vacant_.begin(), vacant_.end(), std::greater<>());
}

void Volume::make_room(std::size_t needed, std::span<const Brick> keep, std::uint32_t now) {
  const std::size_t available = vacant_.size() + (capacity_ - high_slot_);
  if (needed <= available) return;
  const auto states = slot_states();
  const std::unordered_set<Brick, BrickHash> kept(keep.begin(), keep.end());
  struct Candidate {
    std::uint32_t last_seen, slot;
    Brick brick;
  };
  std::vector<Candidate> candidates;
  for (const auto& [brick, slot] : slot_of_)
    if (!kept.contains(brick) && (now == 0 || states[slot].last_seen != now))
      candidates.push_back({states[slot].last_seen, slot, brick});
  if (candidates.size() + available < needed)
    throw std::runtime_error("the device memory for " + std::to_string(capacity_) + " bricks does not hold one view: " +
                             "raise FuseOptions::device_memory or FuseOptions::voxel_size");
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.last_seen != b.last_seen ? a.last_seen < b.last_seen : before(a.brick, b.brick);
  });
  // Evicts a quarter of the pool at once, to make room for the next frames.
  const std::size_t count = std::min(candidates.size(), std::max<std::size_t>(needed - available, capacity_ / 4));
  std::vector<std::uint32_t> slots;
  for (std::size_t i = 0; i < count; ++i) slots.push_back(candidates[i].slot);
  std::sort(slots.begin(), slots.end());
  evict(slots);
}

void Volume::make_resident(std::span<const Brick> bricks, std::uint32_t now) {
  std::vector<Brick> missing;
  for (const Brick& brick : bricks)
    if (in_window(brick) && !slot_of_.contains(brick)) missing.push_back(brick);
  std::sort(missing.begin(), missing.end(), before);
  missing.erase(std::unique(missing.begin(), missing.end()), missing.end());
  if (missing.empty()) return;
  try {
    make_room(missing.size(), bricks, now);
  } catch (const std::runtime_error&) {
    gpu::Batch batch(device_);  // resets the table entries; pending bricks would never be requested again
    for (const Brick& brick : missing)
      batch.fill(page_table_, entry_without_slot(brick), 4 * std::uint64_t{table_index(brick)}, 4);
    batch.submit();
    throw;
  }

  for (std::size_t begin = 0; begin < missing.size(); begin += kBricksPerCopy) {
    std::vector<shader::Placement> placements;
    for (std::size_t i = begin; i < std::min(begin + kBricksPerCopy, missing.size()); ++i) {
      std::uint32_t slot = high_slot_;
      if (vacant_.empty()) {
        ++high_slot_;
      } else {
        slot = vacant_.back();
        vacant_.pop_back();
      }
      slot_of_.emplace(missing[i], slot);
      brick_in_.resize(high_slot_);
      brick_in_[slot] = missing[i];
      placements.push_back(
          {.brick = missing[i], .slot = slot, .table_index = table_index(missing[i]), .entry = slot + 1});
    }
    gpu::Batch batch(device_);
    place(batch, placements, now);
    for (const auto& placement : placements) {
      const std::uint64_t* voxels = host_.find(placement.brick);
      voxels != nullptr ? ++counts_.paged_in : ++counts_.allocated;
      if (voxels != nullptr) batch.upload(voxels_, std::span(voxels, 512), placement.slot * kBrickBytes);
    }
    batch.submit();
    for (const auto& placement : placements) host_.erase(placement.brick);
  }
}

void Volume::place(gpu::Batch& batch, std::span<const shader::Placement> placements, std::uint32_t fused_count) {
  if (placements_.size() < placements.size_bytes())
    placements_ = gpu::Buffer(device_, std::max(placements.size_bytes(), kBricksPerCopy * sizeof(shader::Placement)));
  if (placements.empty()) return;
  batch.upload(placements_, placements);
  const auto count = static_cast<std::uint32_t>(placements.size());
  place_(batch, {64 * count, 1, 1}, {.voxels = view().voxels, .count = count, .fused_count = fused_count},
         {&placements_, &page_table_, &slots_});
}

void Volume::page_in(std::span<const Brick> bricks) {
  std::vector<Brick> existing;
  for (const Brick& brick : bricks)
    if (slot_of_.contains(brick) || host_.find(brick) != nullptr) existing.push_back(brick);
  make_resident(existing, 0);
}

void Volume::page_in_around(const Eigen::Vector3d& center) {
  move_window(center);
  std::vector<std::pair<double, Brick>> near;
  bool all_here = true;
  for (const Brick& brick : host_.bricks()) {
    if (!in_window(brick)) continue;
    near.emplace_back(
        ((brick.cast<double>().array() + 0.5).matrix() * static_cast<double>(brick_size()) - center).norm(), brick);
    all_here = all_here && slot_of_.contains(brick);
  }
  if (all_here) return;
  std::sort(near.begin(), near.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first < b.first : before(a.second, b.second);
  });
  std::vector<Brick> bricks;
  for (std::size_t i = 0; i < std::min<std::size_t>(near.size(), capacity_ / 2); ++i) bricks.push_back(near[i].second);
  page_in(bricks);
}

std::size_t Volume::size() const { return slot_of_.size() + last_seen_.size(); }

std::vector<Brick> Volume::bricks() const {
  std::vector<Brick> all = host_.bricks();
  for (const auto& [brick, slot] : slot_of_)
    if (host_.find(brick) == nullptr) all.push_back(brick);
  std::sort(all.begin(), all.end(), before);
  return all;
}

std::vector<std::uint32_t> Volume::slots_in_use() const {
  std::vector<std::uint32_t> slots;
  for (const auto& [brick, slot] : slot_of_) slots.push_back(slot);
  std::sort(slots.begin(), slots.end());
  return slots;
}

const BrickTree& Volume::on_host() {
  copy_to(host_, slots_in_use());
  return host_;
}

BrickList Volume::list() {
  const std::vector<std::uint32_t> slots = slots_in_use();
  BrickList list{.bricks = {}, .voxels = {}, .free = host_.copy_free()};
  for (const std::uint32_t slot : slots) list.bricks.push_back(brick_in_[slot]);
  host_.visit([&](const Brick& brick) {
    if (!slot_of_.contains(brick)) list.bricks.push_back(brick);
  });
  list_voxels(list, slots);
  return list;
}

/// Fills in the voxels: the first bricks of the list are in `slots`, the rest is on the host.
void Volume::list_voxels(BrickList& list, std::span<const std::uint32_t> slots) {
  list.voxels.resize(list.bricks.size());
  read(slots, std::span(list.voxels).first(slots.size()));
  for (std::size_t i = slots.size(); i < list.bricks.size(); ++i)
    std::copy_n(host_.find(list.bricks[i]), list.voxels[i].size(), list.voxels[i].begin());
}

BrickList Volume::split(std::uint32_t since, const Eigen::Vector3d& center, float radius) {
  const auto is_kept = [&](const Brick& brick) {
    const Eigen::Vector3d at = (brick.cast<double>().array() + 0.5) * static_cast<double>(brick_size());
    return (at - center).norm() < static_cast<double>(radius);
  };
  const auto states = slot_states();
  std::vector<std::uint32_t> seen, leaving;
  for (const std::uint32_t slot : slots_in_use()) {
    const bool is_seen = states[slot].last_seen >= since;
    if (is_seen) seen.push_back(slot);
    if (!is_seen || !is_kept(brick_in_[slot])) leaving.push_back(slot);
  }
  BrickList submap;
  BrickTree next;
  for (const std::uint32_t slot : seen) submap.bricks.push_back(brick_in_[slot]);
  std::vector<shader::Placement> removed;
  for (const Brick& brick : host_.bricks()) {
    if (slot_of_.contains(brick)) continue;
    const bool is_seen = last_seen_[brick] >= since;
    if (is_seen) submap.bricks.push_back(brick);
    if (is_seen && is_kept(brick))
      next.put(brick, std::span<const std::uint64_t, 512>(host_.find(brick), 512));
    else if (in_window(brick))
      removed.push_back({.brick = brick, .slot = shader::kNoSlot, .table_index = table_index(brick), .entry = 0});
  }
  list_voxels(submap, seen);
  for (const Brick& brick : host_.free_bricks()) {
    const BrickBits voxels = host_.free_voxels(brick);
    submap.free.mark_free(brick, voxels);
    if (is_kept(brick)) next.mark_free(brick, voxels);
  }
  host_ = std::move(next);
  last_seen_.clear();
  gpu::Batch batch(device_);
  place(batch, removed, 0);
  batch.submit();
  vacate(leaving);
  refresh_window(origin_);
  return submap;
}

Volume::SavedState Volume::save() {
  SavedState r{.origin = origin_, .counts = counts_};
  const auto states = slot_states();
  // Sorted by brick, because slot numbers are arbitrary.
  for (const auto& [brick, slot] : slot_of_) r.on_device.push_back(brick);
  std::sort(r.on_device.begin(), r.on_device.end(), before);
  for (const Brick& brick : r.on_device) r.device_last_seen.push_back(states[slot_of_.at(brick)].last_seen);
  for (const auto& [brick, seen] : last_seen_) r.on_host.push_back(brick);
  std::sort(r.on_host.begin(), r.on_host.end(), before);
  for (const Brick& brick : r.on_host) r.host_last_seen.push_back(last_seen_.at(brick));
  return r;
}

void Volume::restore(BrickTree tree, const SavedState& r) {
  origin_ = r.origin;
  adopt(std::move(tree));
  // With another window or less memory than before, some bricks stay on the host.
  make_resident(std::span(r.on_device).first(std::min<std::size_t>(r.on_device.size(), capacity_)), 0);
  auto states = slot_states();
  for (std::size_t i = 0; i < r.on_device.size(); ++i)
    if (const std::uint32_t slot = slot_of(r.on_device[i]); slot != kNoSlot)
      states[slot].last_seen = r.device_last_seen[i];
    else
      last_seen_[r.on_device[i]] = r.device_last_seen[i];
  gpu::Batch batch(device_);
  batch.upload(slots_, states);
  batch.submit();
  for (std::size_t i = 0; i < r.on_host.size(); ++i) last_seen_[r.on_host[i]] = r.host_last_seen[i];
  counts_ = r.counts;
}

void Volume::adopt(BrickTree tree) {
  slot_of_.clear();
  last_seen_.clear();
  vacant_.clear();
  high_slot_ = 0;
  host_ = std::move(tree);
  gpu::Batch batch(device_);
  batch.fill(page_table_, 0);
  batch.fill(slots_, 0);
  batch.submit();
  refresh_window(std::nullopt);
}

}  // namespace cairn
