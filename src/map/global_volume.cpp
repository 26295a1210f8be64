// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/global_volume.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>

namespace cairn {
namespace {

constexpr double kMinMotion = 0.25;                             // voxels
constexpr int kCellBricks = 8;                                  // bricks per side of a region merged together
constexpr std::size_t kMaxPlacedBricks = std::size_t{1} << 19;  // submap bricks with their poses: 72 MiB

using Bricks = std::unordered_set<Brick, BrickHash>;

/// Submap bricks with their poses.
struct Placed {
  std::size_t submap;
  std::span<const PlacedBrick> bricks;
};

Eigen::Vector3d center_of(const Brick& brick, double size) {
  return (brick.cast<double>().array() + 0.5).matrix() * size;
}

/// Calls `visit` with the world bricks that overlap a moved brick.
template <class Visit>
void cover(const Brick& brick, const Eigen::Isometry3d& world_from_submap, double size, const Visit& visit) {
  constexpr double kTolerance = 1e-4;  // share of a brick: tolerance, so that an unmoved brick covers only itself
  Eigen::AlignedBox3d box;
  for (int corner = 0; corner < 8; ++corner)
    box.extend(world_from_submap *
               ((brick.cast<double>() + Eigen::Vector3d(corner & 1, corner >> 1 & 1, corner >> 2)) * size));
  const Brick min_brick = (box.min().array() / size + kTolerance).floor().cast<int>().matrix();
  const Brick high = (box.max().array() / size - kTolerance).floor().cast<int>().matrix();
  for (int x = min_brick.x(); x <= high.x(); ++x)
    for (int y = min_brick.y(); y <= high.y(); ++y)
      for (int z = min_brick.z(); z <= high.z(); ++z) visit(Brick(x, y, z));
}

/// Maximum motion of a brick's corners between two poses; meters.
double max_motion(const Brick& brick, const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double size) {
  const Eigen::Vector3d center = center_of(brick, size);
  return (a * center - b * center).norm() + (a.linear() - b.linear()).norm() * size * std::sqrt(3.0) / 2;
}

/// Merge jobs: for each world brick, the nearest overlapping brick of each submap.
std::vector<MergeJob> jobs_of(const Bricks& output_bricks, const std::vector<Placed>& placed, double size) {
  std::unordered_map<Brick, std::vector<std::pair<MergeShare, double>>, BrickHash> shares;
  for (const Placed& of_submap : placed)
    for (const PlacedBrick& p : of_submap.bricks)
      cover(p.brick, p.world_from_submap, size, [&](const Brick& target) {
        if (!output_bricks.contains(target)) return;
        const double distance =
            (p.world_from_submap * center_of(p.brick, size) - center_of(target, size)).squaredNorm();
        auto& of_target = shares[target];
        if (of_target.empty() || of_target.back().first.submap != of_submap.submap)
          of_target.push_back({{of_submap.submap, p.world_from_submap.inverse()}, distance});
        else if (distance < of_target.back().second)
          of_target.back() = {{of_submap.submap, p.world_from_submap.inverse()}, distance};
      });
  std::vector<Brick> bricks(output_bricks.begin(), output_bricks.end());
  std::sort(bricks.begin(), bricks.end(),
            [](const Brick& a, const Brick& b) { return before_by_cell(a, b, kCellBricks); });
  std::vector<MergeJob> jobs;
  for (const Brick& brick : bricks) {
    MergeJob& job = jobs.emplace_back(MergeJob{.target = brick, .shares = {}});
    if (const auto of_target = shares.find(brick); of_target != shares.end())
      for (const auto& [share, distance] : of_target->second) job.shares.push_back(share);
  }
  return jobs;
}

/// Voxels of a world brick that are in free voxels of a submap. `submap_from_world`: in voxels.
BrickBits free_voxels(const Brick& target, const BrickTree& submap, const Eigen::Isometry3d& submap_from_world) {
  const Eigen::Vector3d first = (8 * target).cast<double>();
  Eigen::AlignedBox3d box;
  for (int corner = 0; corner < 8; ++corner)
    box.extend(submap_from_world * (first + 7 * Eigen::Vector3d(corner & 1, corner >> 1 & 1, corner >> 2)));
  const auto brick_of = [](const Eigen::Vector3d& voxel) {
    return Brick(voxel.array().round().cast<int>().unaryExpr([](int i) { return i >> 3; }));
  };
  const Brick min_brick = brick_of(box.min()),
              extent = brick_of(box.max()) - min_brick + Brick::Ones();  // at most three bricks
  std::array<BrickBits, 27> neighbors{};
  bool is_all_free = true, is_any_free = false;
  for (int i = 0; i < extent.prod(); ++i) {
    const Brick at(i / (extent.y() * extent.z()), i / extent.z() % extent.y(), i % extent.z());
    BrickBits& bits = neighbors[static_cast<std::size_t>((at.x() * 3 + at.y()) * 3 + at.z())];
    bits = submap.free_voxels(min_brick + at);
    is_all_free = is_all_free && bits == kAllBits;
    is_any_free = is_any_free || bits != kNoBits;
  }
  if (is_all_free) return kAllBits;
  BrickBits found{};
  for (int i = 0; is_any_free && i < 512; ++i) {
    const Eigen::Vector3d voxel = submap_from_world * (first + Eigen::Vector3d(i >> 6, i >> 3 & 7, i & 7));
    const Eigen::Vector3i v = voxel.array().round().cast<int>().matrix() - 8 * min_brick;
    const BrickBits& bits = neighbors[static_cast<std::size_t>(((v.x() >> 3) * 3 + (v.y() >> 3)) * 3 + (v.z() >> 3))];
    const std::uint64_t bit = bits[static_cast<std::size_t>(v.x() & 7)] >> (8 * (v.y() & 7) + (v.z() & 7)) & 1;
    found[static_cast<std::size_t>(i >> 6)] |= bit << (i & 63);
  }
  return found;
}

/// Current poses of a submap's bricks.
std::vector<Eigen::Isometry3d> brick_poses(const std::vector<Brick>& bricks, const Deformation& deformation,
                                           double size) {
  std::vector<Eigen::Isometry3d> poses(bricks.size());
  tbb::parallel_for(std::size_t{0}, poses.size(),
                    [&](std::size_t i) { poses[i] = deformation(center_of(bricks[i], size)); });
  return poses;
}

std::vector<PlacedBrick> place(const PlacedSubmap& submap, double size) {
  const std::vector<Brick> bricks = submap.bricks->sorted();
  const std::vector<Eigen::Isometry3d> poses = brick_poses(bricks, submap.deformation, size);
  std::vector<PlacedBrick> placed;
  placed.reserve(bricks.size());
  for (std::size_t i = 0; i < bricks.size(); ++i) placed.push_back({bricks[i], poses[i]});
  return placed;
}

}  // namespace

BrickTree free_space(const FuseOptions& options, const std::vector<PlacedSubmap>& submaps, const LoadFree& load) {
  const auto voxel = static_cast<double>(options.voxel_size), size = 8 * voxel;
  BrickTree free;
  for (const PlacedSubmap& submap : submaps) {
    const std::shared_ptr<const BrickTree> submap_free = load(submap.id);
    const std::vector<Brick> bricks = submap_free->free_bricks();
    const std::vector<Eigen::Isometry3d> poses = brick_poses(bricks, submap.deformation, size);
    // For each output brick: the nearest submap brick that overlaps it, for its pose.
    std::unordered_map<Brick, std::pair<std::size_t, double>, BrickHash> nearest;
    for (std::size_t i = 0; i < bricks.size(); ++i)
      cover(bricks[i], poses[i], size, [&](const Brick& target) {
        const double distance = (poses[i] * center_of(bricks[i], size) - center_of(target, size)).squaredNorm();
        const auto [of_target, is_new] = nearest.try_emplace(target, i, distance);
        if (!is_new && distance < of_target->second.second) of_target->second = {i, distance};
      });
    const std::vector<std::pair<Brick, std::pair<std::size_t, double>>> targets(nearest.begin(), nearest.end());
    std::vector<BrickBits> found(targets.size());
    tbb::parallel_for(std::size_t{0}, targets.size(), [&](std::size_t t) {
      Eigen::Isometry3d submap_from_world = poses[targets[t].second.first].inverse();
      submap_from_world.translation() /= voxel;
      found[t] = free_voxels(targets[t].first, *submap_free, submap_from_world);
    });
    for (std::size_t t = 0; t < targets.size(); ++t) free.mark_free(targets[t].first, found[t]);
  }
  return free;
}

std::vector<ReachedCell> reached_cells(const FuseOptions& options, const std::vector<PlacedSubmap>& submaps, int side,
                                       int margin) {
  const double size = 8.0 * static_cast<double>(options.voxel_size);
  struct Reached {
    bool has_brick = false;
    std::vector<std::size_t> submaps;
  };
  std::map<Brick, Reached, decltype(&before)> cells(&before);
  for (const PlacedSubmap& submap : submaps) {
    std::unordered_map<Brick, bool, BrickHash> overlapped;  // true if the cell contains a brick
    for (const PlacedBrick& p : place(submap, size))
      cover(p.brick, p.world_from_submap, size, [&](const Brick& target) {
        const Brick own = cell_of(target, side), min_brick = cell_of(target - Brick::Constant(margin), side),
                    extent = cell_of(target + Brick::Constant(margin), side) - min_brick + Brick::Ones();
        for (int i = 0; i < extent.prod(); ++i) {
          const Brick at =
              min_brick + Brick(i / (extent.y() * extent.z()), i / extent.z() % extent.y(), i % extent.z());
          overlapped[at] = overlapped[at] || at == own;
        }
      });
    for (const auto& [cell, has_brick] : overlapped) {
      Reached& r = cells[cell];
      r.has_brick = r.has_brick || has_brick;
      r.submaps.push_back(submap.id);
    }
  }
  std::vector<ReachedCell> list;
  for (auto& [cell, overlapped] : cells)
    if (overlapped.has_brick) list.push_back({cell, std::move(overlapped.submaps)});
  return list;
}

GlobalVolumeChunks::GlobalVolumeChunks(gpu::Device& device, const FuseOptions& options,
                                       std::vector<PlacedSubmap> submaps)
    : brick_size_(8.0 * static_cast<double>(options.voxel_size)), merger_(device, options) {
  for (PlacedSubmap& submap : submaps) {
    Submap& s = submaps_.emplace_back(Submap{.placed = std::move(submap), .overlapped = {}, .bricks = {}});
    for (const PlacedBrick& p : place(s.placed, brick_size_))
      cover(p.brick, p.world_from_submap, brick_size_, [&](const Brick& target) {
        overlapped_.insert(target);
        s.overlapped.extend(target);
      });
  }
}

std::vector<const GlobalVolumeChunks::Submap*> GlobalVolumeChunks::overlapping(const BrickBox& box) {
  std::vector<const Submap*> found;
  std::size_t bricks = 0;
  for (Submap& s : submaps_) {
    if (!s.overlapped.intersects(box)) continue;
    if (s.bricks.empty()) s.bricks = place(s.placed, brick_size_);
    s.last_use = ++use_;
    found.push_back(&s);
  }
  for (const Submap& s : submaps_) bricks += s.bricks.size();
  while (bricks > kMaxPlacedBricks) {
    Submap& oldest = *std::min_element(submaps_.begin(), submaps_.end(), [](const Submap& a, const Submap& b) {
      return std::pair(a.bricks.empty(), a.last_use) < std::pair(b.bricks.empty(), b.last_use);
    });
    if (oldest.last_use + found.size() > use_) break;  // in use by this call
    bricks -= oldest.bricks.size();
    oldest.bricks = {};
  }
  return found;
}

BrickTree GlobalVolumeChunks::make(std::span<const Brick> bricks, const LoadSubmap& load) {
  BrickBox box;
  for (const Brick& brick : bricks) box.extend(brick);
  std::vector<Placed> placed;
  for (const Submap* s : overlapping(box)) placed.push_back({s->placed.id, s->bricks});
  BrickTree tree;
  merger_.merge(jobs_of(Bricks(bricks.begin(), bricks.end()), placed, brick_size_), load, tree);
  return tree;
}

GlobalVolume::GlobalVolume(gpu::Device& device, const FuseOptions& options)
    : options_(options), merger_(device, options) {}

BrickTree GlobalVolume::release() {
  placements_.clear();
  return std::exchange(bricks_, BrickTree());
}

std::vector<Brick> GlobalVolume::update(const std::vector<PlacedSubmap>& submaps, const LoadSubmap& load,
                                        const LoadFree& load_free) {
  const double size = 8.0 * static_cast<double>(options_.voxel_size),
               tolerance = kMinMotion * static_cast<double>(options_.voxel_size);
  Bricks changed;
  const auto touch = [&](const Brick& brick) { changed.insert(brick); };
  std::vector<bool> present(placements_.size(), false);
  for (const PlacedSubmap& submap : submaps) {
    if (placements_.size() <= submap.id) placements_.resize(submap.id + 1), present.resize(submap.id + 1);
    present[submap.id] = true;
    std::vector<PlacedBrick> now = place(submap, size);
    std::vector<PlacedBrick>& placed = placements_[submap.id];
    const bool is_new = placed.empty();
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (!is_new &&
          max_motion(now[i].brick, placed[i].world_from_submap, now[i].world_from_submap, size) < tolerance) {
        now[i] = placed[i];
        continue;
      }
      if (!is_new) cover(placed[i].brick, placed[i].world_from_submap, size, touch);
      cover(now[i].brick, now[i].world_from_submap, size, touch);
    }
    placed = std::move(now);
  }
  for (std::size_t id = 0; id < placements_.size(); ++id) {
    if (present[id]) continue;
    for (const PlacedBrick& p : placements_[id]) cover(p.brick, p.world_from_submap, size, touch);
    placements_[id].clear();
  }

  std::vector<Brick> bricks(changed.begin(), changed.end());
  std::vector<Placed> all;
  for (std::size_t id = 0; id < placements_.size(); ++id) all.push_back({id, placements_[id]});
  merger_.merge(jobs_of(changed, all, size), load, bricks_);
  if (!bricks.empty()) {
    const std::vector<Brick> moved = replace_free_space(free_space(options_, submaps, load_free));
    bricks.insert(bricks.end(), moved.begin(), moved.end());
  }
  std::sort(bricks.begin(), bricks.end(), before);
  bricks.erase(std::unique(bricks.begin(), bricks.end()), bricks.end());
  return bricks;
}

/// Returns the changed bricks.
std::vector<Brick> GlobalVolume::replace_free_space(BrickTree free) {
  const std::vector<Brick> free_before = bricks_.free_bricks(), free_now = free.free_bricks();
  std::vector<Brick> changed;
  std::set_union(free_before.begin(), free_before.end(), free_now.begin(), free_now.end(), std::back_inserter(changed),
                 before);
  std::erase_if(changed, [&](const Brick& brick) { return bricks_.free_voxels(brick) == free.free_voxels(brick); });
  bricks_.take_free(std::move(free));
  return changed;
}

}  // namespace cairn
