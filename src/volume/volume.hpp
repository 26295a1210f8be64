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

#include "cairn/options.hpp"
#include "gpu/kernel.hpp"
#include "shaders/volume.h"
#include "volume/grids.hpp"

namespace cairn {

using Brick = Eigen::Vector3i;  // brick coordinates: voxel / 8

struct BrickHash {
  std::size_t operator()(const Brick& b) const {  // Teschner et al. 2003
    return static_cast<std::size_t>(b.x()) * 73856093u ^ static_cast<std::size_t>(b.y()) * 19349669u ^
           static_cast<std::size_t>(b.z()) * 83492791u;
  }
};

/// The cube of `bricks` bricks a side that a brick lies in.
[[nodiscard]] inline Brick cell_of(const Brick& brick, int bricks) {
  return brick.unaryExpr([bricks](int i) { return (i - (i % bricks + bricks) % bricks) / bricks; });
}

/// An order that keeps the bricks of a cell together: by x, y and z of the cell, then of the brick.
[[nodiscard]] inline bool before_by_cell(const Brick& a, const Brick& b, int bricks) {
  const Brick ca = cell_of(a, bricks), cb = cell_of(b, bricks);
  return std::tie(ca.x(), ca.y(), ca.z(), a.x(), a.y(), a.z()) < std::tie(cb.x(), cb.y(), cb.z(), b.x(), b.y(), b.z());
}

/// Sparse voxels: those around the camera in a pool on the device, found through a page table that follows the camera,
/// the others in an OpenVDB tree on the host. A brick is at one place at a time. Layout: shaders/volume.h.
class Volume {
 public:
  struct Counts {
    std::uint64_t allocated = 0, paged_out = 0, paged_in = 0;  // bricks so far
  };
  /// `reach`: metres around the camera that the page table covers. Throws std::runtime_error when the budget
  /// (FuseOptions::device_memory) holds too few bricks.
  Volume(gpu::Device& device, const FuseOptions& options, float reach);

  [[nodiscard]] const FuseOptions& options() const { return options_; }
  [[nodiscard]] gpu::Device& device() const { return device_; }
  [[nodiscard]] float brick_size() const { return 8 * options_.voxel_size; }  // metres
  /// What a kernel needs to find voxels, with the page table as a binding.
  [[nodiscard]] shader::VolumeView view() const;
  [[nodiscard]] const gpu::Buffer& voxels() const { return voxels_; }  // kBrickVoxels by slot
  /// Whether the device can read all voxels as texels; see VoxelKernel.
  [[nodiscard]] bool is_read_as_texels() const { return voxels_.size() / 8 <= device_.max_texels(); }
  [[nodiscard]] const gpu::Buffer& page_table() const { return page_table_; }
  [[nodiscard]] const gpu::Buffer& free_marks() const { return free_marks_; }  // by entry a bit: all of it is free
  [[nodiscard]] const gpu::Buffer& slots() const { return slots_; }            // SlotState by slot
  [[nodiscard]] std::uint32_t slot_count() const { return high_slot_; }        // slots in use lie below it
  [[nodiscard]] std::uint32_t capacity() const { return capacity_; }           // bricks the device holds at most

  /// Moves the window so that `centre` (metres, submap frame) is in its middle; bricks that leave it go to the host.
  void move_window(const Eigen::Vector3d& centre);
  /// Moves it into the middle of bricks that are not all in it.
  void move_window_to(std::span<const Brick> bricks);
  /// Brings bricks to the device: those the host has with their voxels, others empty. Bricks outside the window are
  /// left out. When the pool is full, bricks last seen longest ago make room, but none of `bricks` and none seen at
  /// `now`. Throws std::runtime_error when that is not enough.
  void make_resident(std::span<const Brick> bricks, std::uint32_t now);
  /// At most so many slots that hold nothing, for a kernel to give to bricks (shaders/brick_mark.comp), and what it
  /// gave: returns the bricks that it left without one.
  [[nodiscard]] std::vector<std::uint32_t> vacant_slots(std::uint32_t most) const;
  [[nodiscard]] std::vector<Brick> note_placed(std::span<const shader::Placement> placements);
  /// Like make_resident, but leaves out bricks that exist nowhere; the others may all make room.
  void page_in(std::span<const Brick> bricks);
  /// Moves the window to a place where the camera may be and brings the bricks around it that the host has.
  void bring(const Eigen::Vector3d& centre);
  [[nodiscard]] std::uint32_t slot_of(const Brick& brick) const;  // slot, or kNoSlot
  static constexpr std::uint32_t kNoSlot = 0xffffffffu;
  [[nodiscard]] const Brick& brick_in(std::uint32_t slot) const { return brick_in_[slot]; }  // of a slot in use

  /// Notes on the host what a camera has looked through, and on the device which bricks are free as a whole. Returns
  /// the bricks of which something is new.
  std::vector<Brick> mark_free(const BrickMarks& marks);

  /// All bricks, on the device or the host, sorted by x, then y, then z.
  [[nodiscard]] std::vector<Brick> bricks() const;
  [[nodiscard]] std::size_t size() const;  // bricks, about: those on the host may be counted twice
  /// The host's tree with every brick in it: those on the device are copied and stay there.
  [[nodiscard]] const BrickTree& on_host();
  /// The host's tree as it is: of bricks on the device it holds no or old voxels.
  [[nodiscard]] const BrickTree& host() const { return host_; }
  /// Copies of all bricks, on the device or the host.
  [[nodiscard]] BrickList list();

  /// Ends a submap: returns copies of the bricks that were seen at `since` or later. Of these the ones within `radius`
  /// (metres) of `centre` stay for the next submap; all others are dropped.
  [[nodiscard]] BrickList split(std::uint32_t since, const Eigen::Vector3d& centre, float radius);

  /// Which bricks are where, to go on with later: together with on_host() all of the volume.
  struct Residency {
    Brick origin = Brick::Zero();           // of the window
    std::vector<Brick> on_device, on_host;  // bricks and the stamps at which they were last seen
    std::vector<std::uint32_t> device_last_seen, host_last_seen;
    Counts counts;
  };
  [[nodiscard]] Residency residency();
  void restore(BrickTree tree, const Residency& residency);

  /// Takes over a whole map; whatever was there is gone. The bricks come to the device when they are asked for.
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
  std::vector<std::uint32_t> vacant_;  // slots below high_slot_ that hold nothing, the lowest last
  std::unordered_map<Brick, std::uint32_t, BrickHash> slot_of_;
  std::vector<Brick> brick_in_;  // by slot; those not in use hold any
  BrickTree host_;
  std::unordered_map<Brick, std::uint32_t, BrickHash> last_seen_;  // of bricks that went to the host
  Counts counts_;
  std::vector<std::uint32_t> marks_;  // what free_marks_ holds
};

}  // namespace cairn
