// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/join.hpp"

#include <algorithm>
#include <map>
#include <utility>

namespace cairn {
namespace {

constexpr std::size_t kAgreeing = 3;                   // loops that join two pieces
constexpr double kAgreeTurn = 0.1, kAgreeShift = 0.3;  // radians, metres that these may differ by: both have drifted
// Radians, metres by which pieces that others have joined may have drifted: as many loops as join two are believed up
// to here, and rooms that look alike are farther from each other.
constexpr double kDriftTurn = 0.2, kDriftShift = 1;
constexpr double kClear = 2;  // times as many loops as tell the next best

/// Loops between two pieces that agree with each other, the one first that most of them agree with.
using Cluster = std::vector<const Loop*>;

struct Pair {
  std::size_t first, second;      // pieces
  std::vector<Cluster> clusters;  // the largest first
};

bool is_within(const Eigen::Isometry3d& motion, double turn, double shift) {
  const Vector6d v = local_coordinates(motion);
  return v.head<3>().norm() < turn && v.tail<3>().norm() < shift;
}

/// Where a loop's second keyframe lies in the world, by it.
Eigen::Isometry3d told(const Atlas& atlas, const Loop& loop) {
  return atlas.world_from_camera[loop.edge.i] * loop.edge.i_from_j;
}

/// How the piece of a loop's second keyframe is to be moved, by it.
Eigen::Isometry3d move_of(const Atlas& atlas, const Loop& loop) {
  return told(atlas, loop) * atlas.world_from_camera[loop.edge.j].inverse();
}

/// Compared where the other one's keyframe is, so that a turn far away is no shift.
bool agree(const Atlas& atlas, const Loop& a, const Loop& b) {
  const Eigen::Isometry3d by_a = move_of(atlas, a) * atlas.world_from_camera[b.edge.j];
  return is_within(by_a.inverse() * told(atlas, b), kAgreeTurn, kAgreeShift);
}

std::vector<Cluster> clusters_of(const Atlas& atlas, std::vector<const Loop*> loops) {
  std::vector<Cluster> clusters;
  while (!loops.empty()) {
    Cluster largest;
    for (const Loop* loop : loops) {
      Cluster cluster{loop};
      for (const Loop* other : loops)
        if (other != loop && agree(atlas, *loop, *other)) cluster.push_back(other);
      if (cluster.size() > largest.size()) largest = std::move(cluster);
    }
    std::erase_if(loops, [&](const Loop* l) { return std::find(largest.begin(), largest.end(), l) != largest.end(); });
    clusters.push_back(std::move(largest));
  }
  return clusters;
}

/// Pieces with loops between them, those first that most loops agree about. Pieces have their first keyframe's number.
std::vector<Pair> pairs_of(const Atlas& atlas, const std::vector<Loop>& loops) {
  const auto piece = atlas.components();
  std::map<std::pair<std::size_t, std::size_t>, std::vector<const Loop*>> between;
  for (const Loop& loop : loops) {
    const std::size_t i = piece[loop.edge.i], j = piece[loop.edge.j];
    between[{std::min(i, j), std::max(i, j)}].push_back(&loop);
  }
  std::vector<Pair> pairs;
  for (auto& [pieces, of_pair] : between)
    pairs.push_back({pieces.first, pieces.second, clusters_of(atlas, std::move(of_pair))});
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.clusters.front().size() > b.clusters.front().size(); });
  return pairs;
}

bool is_clear(const Pair& pair) {
  const auto most = static_cast<double>(pair.clusters[0].size());
  return pair.clusters[0].size() >= kAgreeing &&
         (pair.clusters.size() == 1 || most >= kClear * static_cast<double>(pair.clusters[1].size()));
}

}  // namespace

std::size_t join_pieces(Atlas& atlas, const std::vector<Loop>& loops) {
  const std::vector<Pair> pairs = pairs_of(atlas, loops);
  // A loop of each joining cluster ties the pieces for now, so that Atlas knows what moves together.
  const std::size_t before = atlas.loops.size();
  for (const Pair& pair : pairs) {
    const auto piece = atlas.components();
    if (piece[pair.first] == piece[pair.second] || !is_clear(pair)) continue;
    atlas.join(pair.clusters[0].front()->edge);
    atlas.loops.push_back(*pair.clusters[0].front());
  }
  const auto piece = atlas.components();
  atlas.loops.resize(before);
  std::size_t added = 0;
  for (const Pair& pair : pairs) {
    if (piece[pair.first] != piece[pair.second]) continue;
    for (const Cluster& cluster : pair.clusters) {
      const bool are_many = cluster.size() >= kAgreeing;
      for (const Loop* loop : cluster) {
        const Eigen::Isometry3d off = atlas.world_from_camera[loop->edge.j].inverse() * told(atlas, *loop);
        if (!is_within(off, are_many ? kDriftTurn : kAgreeTurn, are_many ? kDriftShift : kAgreeShift)) continue;
        atlas.loops.push_back(*loop);
        ++added;
      }
    }
  }
  return added;
}

}  // namespace cairn
