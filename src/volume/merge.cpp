// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/merge.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <future>
#include <map>
#include <unordered_map>
#include <utility>

#include "spirv/submap_merge.comp.h"

namespace cairn {
namespace {

constexpr std::size_t kSlots = 8192;          // source bricks on the device at once: 32 MiB
constexpr std::size_t kTargets = 4096;        // output bricks per dispatch
constexpr std::size_t kMaxSourceBricks = 27;  // source bricks overlapped by a rotated brick, at most
constexpr std::size_t kJobsPerLoad = 1024;    // output bricks per load of their sources
constexpr std::size_t kMaxShares = 64;  // maximum number of submaps per output brick; the weights saturate long before

/// Free space: far from any surface, with a weight too small to bound a mesh.
const std::uint64_t kFreeVoxel = shader::pack_voxel(1.0f, 1.0f / 16);

/// Pose of an output brick in a submap, and its source bricks.
struct Placed {
  shader::MergeSource source;
  Brick base;
  bool is_plain = false;  // voxels coincide with the voxels of `base`
};

Placed place(const Brick& target, const MergeShare& share, float voxel_size) {
  const Eigen::Vector3d first = (8 * target).cast<double>();
  Eigen::Isometry3d in_voxels = share.submap_from_world;
  in_voxels.translation() = in_voxels.translation() / static_cast<double>(voxel_size) + in_voxels.linear() * first;
  Eigen::AlignedBox3d box;
  for (int corner = 0; corner < 8; ++corner)
    box.extend(in_voxels * Eigen::Vector3d(corner & 1 ? 7 : 0, corner & 2 ? 7 : 0, corner & 4 ? 7 : 0));
  constexpr double kRoundingMargin = 1e-3;  // voxels
  const Brick base = ((box.min().array() + kRoundingMargin).floor() / 8).floor().cast<int>().matrix();
  in_voxels.translation() -= (8 * base).cast<double>();
  const bool is_plain = in_voxels.matrix().isIdentity(1e-4);
  if (is_plain) in_voxels.setIdentity();
  return {{.source_from_target = shader::rigid(in_voxels), .slots = {}}, base, is_plain};
}

Brick around(const Brick& base, std::size_t i) {
  const auto k = static_cast<int>(i);
  return base + Brick(k % 3, k / 3 % 3, k / 9);
}

std::span<const MergeShare> shares_of(const MergeJob& job) {
  return std::span(job.shares).first(std::min(kMaxShares, job.shares.size()));
}

/// Source bricks per submap for some jobs.
std::map<std::size_t, BrickBox> boxes_of(std::span<const MergeJob> jobs, float voxel_size) {
  std::map<std::size_t, BrickBox> boxes;
  for (const MergeJob& job : jobs)
    for (const MergeShare& share : shares_of(job)) {
      const Brick base = place(job.target, share, voxel_size).base;
      boxes[share.submap].extend(base).extend(around(base, kMaxSourceBricks - 1));
    }
  return boxes;
}

}  // namespace

Merger::Merger(gpu::Device& device, const FuseOptions& options)
    : device_(device), options_(options), merge_(device, "submap_merge", submap_merge_comp) {}

/// Collects the voxels of as many jobs, starting at `begin`, as fit into a dispatch.
void Merger::gather(std::span<const MergeJob> jobs, std::size_t begin, const LoadSubmap& submap, Gathered& to) const {
  to.targets.clear();
  to.sources.clear();
  to.voxels.resize(kSlots);
  to.voxels[shader::kEmptySlot].fill(0);
  to.voxels[shader::kFreeSlot].fill(kFreeVoxel);
  to.begin = to.end = begin;
  std::map<std::size_t, BrickBox> boxes;
  std::map<std::size_t, std::shared_ptr<const BrickTree>> parts;
  std::map<std::size_t, std::unordered_map<Brick, std::uint32_t, BrickHash>> slots;
  to.used = shader::kFreeSlot + 1;
  for (; to.end < jobs.size() && to.targets.size() < kTargets; ++to.end) {
    if ((to.end - begin) % kJobsPerLoad == 0) {
      boxes = boxes_of(jobs.subspan(to.end, std::min(kJobsPerLoad, jobs.size() - to.end)), options_.voxel_size);
      parts.clear();
    }
    const MergeJob& job = jobs[to.end];
    const auto shares = shares_of(job);
    if (to.used + kMaxSourceBricks * shares.size() > kSlots) break;
    to.targets.push_back(
        {.first = static_cast<std::uint32_t>(to.sources.size()), .count = static_cast<std::uint32_t>(shares.size())});
    for (const MergeShare& share : shares) {
      auto& part = parts[share.submap];
      if (!part) part = submap(share.submap, boxes.at(share.submap));
      auto& slot_of = slots[share.submap];
      Placed placed = place(job.target, share, options_.voxel_size);
      for (std::size_t i = 0; i < (placed.is_plain ? 1 : kMaxSourceBricks); ++i) {
        const Brick brick = around(placed.base, i);
        const auto [entry, is_new] = slot_of.try_emplace(brick, shader::kEmptySlot);
        if (is_new) {
          if (const std::uint64_t* voxels = part->find(brick)) {
            std::memcpy(to.voxels[to.used].data(), voxels, sizeof(BrickVoxels));
            entry->second = to.used++;
          } else if (part->is_free(brick)) {
            entry->second = shader::kFreeSlot;
          }
        }
        placed.source.slots[i] = entry->second;
      }
      to.sources.push_back(placed.source);
    }
  }
}

void Merger::merge(std::span<const MergeJob> jobs, const LoadSubmap& submap, BrickTree& world) {
  if (jobs.empty()) return;
  // Freed after the merge: the next stages need the memory.
  const gpu::Buffer voxels(device_, kSlots * sizeof(BrickVoxels)), merged(device_, kTargets * sizeof(BrickVoxels)),
      targets(device_, kTargets * sizeof(shader::MergeTarget));
  gpu::Buffer sources(device_, sizeof(shader::MergeSource));  // not empty even if no job has sources
  gpu::Batch batch(device_);
  std::vector<BrickVoxels> result;
  Gathered now, next;
  gather(jobs, 0, submap, now);
  while (true) {
    // Collects the next batch while the device processes the current batch.
    std::future<void> gathering;
    if (now.end < jobs.size())
      gathering = std::async(std::launch::async, [&, begin = now.end] { gather(jobs, begin, submap, next); });
    if (sources.size() < now.sources.size() * sizeof(shader::MergeSource))
      sources = gpu::Buffer(device_, 2 * now.sources.size() * sizeof(shader::MergeSource));
    batch.upload(voxels, std::span<const BrickVoxels>(now.voxels).first(now.used));
    batch.upload(targets, now.targets);
    batch.upload(sources, now.sources);
    const auto count = static_cast<std::uint32_t>(now.targets.size());
    merge_(batch, {64 * count, 1, 1},
           {.voxels = shader::address(voxels), .max_weight = options_.max_weight, .targets = count},
           {&targets, &sources, &merged});
    result.resize(count);
    batch.download(merged, result);
    batch.run();
    for (std::size_t i = 0; i < result.size(); ++i) {
      const bool is_empty = std::all_of(result[i].begin(), result[i].end(), [](std::uint64_t v) { return v == 0; });
      if (is_empty)
        world.erase(jobs[now.begin + i].target);
      else
        world.put(jobs[now.begin + i].target, result[i]);
    }
    if (!gathering.valid()) return;
    gathering.get();
    std::swap(now, next);
  }
}

}  // namespace cairn
