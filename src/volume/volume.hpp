// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "cairn/mapping/options.hpp"
#include "gpu/kernel.hpp"
#include "shaders/volume.h"
#include "volume/vdb/brick_tree.hpp"

namespace cairn {

using Brick = Eigen::Vector3i;  // brick coordinates: voxel / 8

struct BrickHash {
  std::size_t operator()(const Brick& b) const {  // Teschner et al. 2003
    return static_cast<std::size_t>(b.x()) * 73856093u ^ static_cast<std::size_t>(b.y()) * 19349669u ^
           static_cast<std::size_t>(b.z()) * 83492791u;
  }
};

/// Cube of `bricks` bricks per side that contains a brick.
[[nodiscard]] inline Brick cell_of(const Brick& brick, int bricks) {
  return brick.unaryExpr([bricks](int i) { return (i - (i % bricks + bricks) % bricks) / bricks; });
}

/// Order that keeps the bricks of a cell together: by x, y and z of the cell, then of the brick.
[[nodiscard]] inline bool before_by_cell(const Brick& a, const Brick& b, int bricks) {
  const Brick ca = cell_of(a, bricks), cb = cell_of(b, bricks);
  return std::tie(ca.x(), ca.y(), ca.z(), a.x(), a.y(), a.z()) < std::tie(cb.x(), cb.y(), cb.z(), b.x(), b.y(), b.z());
}

/// Sparse voxel volume: bricks around the camera in a pool on the device, addressed by a page table that follows the
/// camera; all others in an OpenVDB tree on the host. Each brick has one current copy. Layout: shaders/volume.h.
class Volume {
 public:
  struct Counts {
    std::uint64_t allocated = 0, paged_out = 0, paged_in = 0;  // bricks so far
  };
  /// `reach`: meters around the camera that the page table covers. Throws std::runtime_error if the budget
  /// (FuseOptions::device_memory) is too small.
  Volume(gpu::Device& device, const FuseOptions& options, float reach);

  [[nodiscard]] const FuseOptions& options() const { return options_; }
  [[nodiscard]] gpu::Device& device() const { return device_; }
  [[nodiscard]] float brick_size() const { return 8 * options_.voxel_size; }  // meters
  /// Parameters with which a kernel finds voxels; the page table is a separate binding.
  [[nodiscard]] shader::VolumeView view() const;
  [[nodiscard]] const gpu::Buffer& voxels() const { return voxels_; }  // kBrickVoxels by slot
  /// True if the device can read all voxels as texels; see VoxelKernel.
  [[nodiscard]] bool is_read_as_texels() const { return voxels_.size() / 8 <= device_.max_texels(); }
  [[nodiscard]] const gpu::Buffer& page_table() const { return page_table_; }
  [[nodiscard]] const gpu::Buffer& free_marks() const { return free_marks_; }  // a bit per entry: completely free
  [[nodiscard]] const gpu::Buffer& slots() const { return slots_; }            // SlotState by slot
  [[nodiscard]] std::uint32_t slot_count() const { return high_slot_; }        // upper bound of the slots in use
  [[nodiscard]] std::uint32_t capacity() const { return capacity_; }           // maximum number of bricks on the device

  /// Moves the window to be centered at `center` (meters, submap frame); bricks outside are evicted to the host.
  void move_window(const Eigen::Vector3d& center);
  /// Centers the window on bricks, unless all of them are inside.
  void move_window_to(std::span<const Brick> bricks);
  /// Makes bricks resident on the device: with the host's voxels if it has them, else empty. Bricks outside the window
  /// are ignored. If the pool is full, evicts the least recently seen bricks, except `bricks` and those seen at `now`.
  /// Throws std::runtime_error if the room does not suffice.
  void make_resident(std::span<const Brick> bricks, std::uint32_t now);
  /// At most `max_count` vacant slots, for a kernel to assign to bricks (shaders/brick_mark.comp); note_placed() takes
  /// its assignments and returns the bricks left without a slot.
  [[nodiscard]] std::vector<std::uint32_t> vacant_slots(std::uint32_t max_count) const;
  [[nodiscard]] std::vector<Brick> note_placed(std::span<const shader::Placement> placements);
  /// Like make_resident(), but ignores missing bricks; all other bricks may be evicted.
  void page_in(std::span<const Brick> bricks);
  /// Moves the window to a possible camera position and pages in the nearest bricks from the host.
  void page_in_around(const Eigen::Vector3d& center);
  [[nodiscard]] std::uint32_t slot_of(const Brick& brick) const;  // the slot, or kNoSlot
  static constexpr std::uint32_t kNoSlot = 0xffffffffu;
  [[nodiscard]] const Brick& brick_in(std::uint32_t slot) const { return brick_in_[slot]; }  // for a slot in use

  /// Records carved free space on the host, and completely free bricks on the device. Returns the bricks with
  /// additional free space.
  std::vector<Brick> mark_free(const BrickMarks& marks);

  /// All bricks, on the device or the host, sorted by x, then y, then z.
  [[nodiscard]] std::vector<Brick> bricks() const;
  [[nodiscard]] std::size_t size() const;  // approximate number of bricks; may count bricks on the host twice
  /// Copies all bricks on the device into the host's tree, and returns the tree. The bricks stay resident.
  [[nodiscard]] const BrickTree& on_host();
  /// Current tree of the host: voxels of bricks on the device are missing or outdated.
  [[nodiscard]] const BrickTree& host() const { return host_; }
  /// Copies of all bricks, on the device or the host.
  [[nodiscard]] BrickList list();

  /// Ends a submap: returns copies of the bricks seen at `since` or later. Of the returned bricks, those within
  /// `radius` (meters) of `center` are kept for the next submap; all others are dropped.
  [[nodiscard]] BrickList split(std::uint32_t since, const Eigen::Vector3d& center, float radius);

  /// Distribution of bricks between device and host; with on_host(), the complete state of the volume.
  struct SavedState {
    Brick origin = Brick::Zero();           // origin of the window
    std::vector<Brick> on_device, on_host;  // bricks, and the frame counts when they were last seen
    std::vector<std::uint32_t> device_last_seen, host_last_seen;
    Counts counts;
  };
  [[nodiscard]] SavedState save();
  void restore(BrickTree tree, const SavedState& saved);

  /// Replaces the contents with a complete map. Its bricks become resident on demand.
  void adopt(BrickTree tree);

  [[nodiscard]] const Counts& counts() const { return counts_; }

 private:
  void refresh_window(const std::optional<Brick>& origin_before);
  [[nodiscard]] std::uint32_t entry_without_slot(const Brick& brick) const;
  void evict(std::span<const std::uint32_t> slots);
  void vacate(std::span<const std::uint32_t> slots);
  void place(gpu::Batch& batch, std::span<const shader::Placement> placements, std::uint32_t fused_count);
  void make_room(std::size_t needed, std::span<const Brick> keep, std::uint32_t now);
  void read(std::span<const std::uint32_t> slots, std::span<BrickVoxels> voxels);
  void list_voxels(BrickList& list, std::span<const std::uint32_t> slots);
  void copy_to(BrickTree& tree, std::span<const std::uint32_t> slots);
  [[nodiscard]] std::vector<shader::SlotState> slot_states();
  [[nodiscard]] std::vector<std::uint32_t> slots_in_use() const;
  [[nodiscard]] bool in_window(const Brick& brick) const;
  [[nodiscard]] bool in_window(const Brick& brick, const Brick& origin) const;
  [[nodiscard]] std::uint32_t table_index(const Brick& brick) const;

  gpu::Device& device_;
  FuseOptions options_;
  std::uint32_t table_bits_, capacity_;
  std::uint32_t high_slot_ = 0;
  Brick origin_ = Brick::Zero();
  gpu::Buffer voxels_, page_table_, free_marks_, slots_, placements_;
  gpu::Kernel<shader::BrickPlacePush> place_;
  std::vector<std::uint32_t> vacant_;  // vacant slots below high_slot_, lowest last
  std::unordered_map<Brick, std::uint32_t, BrickHash> slot_of_;
  std::vector<Brick> brick_in_;  // by slot; arbitrary for vacant slots
  BrickTree host_;
  std::unordered_map<Brick, std::uint32_t, BrickHash> last_seen_;  // bricks evicted to the host
  Counts counts_;
  std::vector<std::uint32_t> marks_;  // host copy of free_marks_
};

}  // namespace cairn
