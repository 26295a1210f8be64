// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/sign_fill.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <map>
#include <unordered_map>

namespace cairn {
namespace {

// BrickBits: word x, bit 8 y + z.
constexpr std::uint64_t kFirstZ = 0x0101010101010101u, kLastZ = kFirstZ << 7, kFirstY = 0xff, kLastY = kFirstY << 56;

BrickBits with_neighbors(const BrickBits& bits) {
  BrickBits grown = bits;
  for (std::size_t x = 0; x < bits.size(); ++x) {
    const std::uint64_t w = bits[x];
    grown[x] |= (w << 1 & ~kFirstZ) | (w >> 1 & ~kLastZ) | w << 8 | w >> 8;
    if (x > 0) grown[x - 1] |= w;
    if (x + 1 < bits.size()) grown[x + 1] |= w;
  }
  return grown;
}

struct BrickHash {
  std::size_t operator()(const std::array<int, 3>& b) const {  // Teschner et al. 2003
    return static_cast<std::size_t>(b[0]) * 73856093 ^ static_cast<std::size_t>(b[1]) * 19349669 ^
           static_cast<std::size_t>(b[2]) * 83492791;
  }
};
using Bricks = std::span<const std::pair<Eigen::Vector3i, BrickBits>>;

std::array<int, 3> key(const Eigen::Vector3i& b) { return {b.x(), b.y(), b.z()}; }

std::unordered_map<std::array<int, 3>, std::size_t, BrickHash> index_of(Bricks bricks) {
  std::unordered_map<std::array<int, 3>, std::size_t, BrickHash> index;
  index.reserve(bricks.size());
  for (std::size_t i = 0; i < bricks.size(); ++i) index.emplace(key(bricks[i].first), i);
  return index;
}

/// Number of voxels behind the surface among the 64 on a side of a brick. `side`: 2 * axis, plus 1 for the upper side.
int behind_at(const BrickBits& behind, int side) {
  const bool is_upper = side % 2 == 1;
  if (side / 2 == 0) return std::popcount(behind[is_upper ? 7 : 0]);
  const std::uint64_t mask = side / 2 == 1 ? (is_upper ? kLastY : kFirstY) : (is_upper ? kLastZ : kFirstZ);
  int count = 0;
  for (const std::uint64_t word : behind) count += std::popcount(word & mask);
  return count;
}

}  // namespace

BrickBits fill_unknown_signs(const BrickBits& known, const BrickBits& behind) {
  BrickBits in = known, back = behind;
  while (true) {
    const BrickBits grown = with_neighbors(in);
    if (grown == in) return back;  // complete, or no voxel is known
    BrickBits front;
    for (std::size_t x = 0; x < in.size(); ++x) front[x] = in[x] & ~back[x];
    const BrickBits in_front = with_neighbors(front);
    for (std::size_t x = 0; x < in.size(); ++x) {
      back[x] |= grown[x] & ~in[x] & ~in_front[x];
      in[x] = grown[x];
    }
  }
}

std::vector<Eigen::Vector3i> inside_neighbors(Bricks bricks, std::size_t own) {
  constexpr int kSide = 64;  // voxels
  const auto index = index_of(bricks);
  std::map<std::array<int, 3>, int> votes;
  for (std::size_t i = 0; i < bricks.size(); ++i)
    for (int side = 0; side < 6; ++side) {
      const auto& [brick, behind] = bricks[i];
      Eigen::Vector3i neighbor = brick;
      neighbor[side / 2] += side % 2 == 1 ? 1 : -1;
      if (index.contains(key(neighbor))) continue;
      const auto neighbor_vote = i < own ? votes.try_emplace(key(neighbor)).first : votes.find(key(neighbor));
      if (neighbor_vote != votes.end()) neighbor_vote->second += 2 * behind_at(behind, side) - kSide;
    }
  std::vector<Eigen::Vector3i> all;
  for (const auto& [brick, vote] : votes)
    if (vote > 0) all.emplace_back(brick[0], brick[1], brick[2]);
  return all;
}

std::vector<Eigen::Vector3i> two_steps() {
  std::vector<Eigen::Vector3i> steps;
  for (int x = -2; x <= 2; ++x)
    for (int y = -2; y <= 2; ++y)
      for (int z = -2; z <= 2; ++z)
        if (const Eigen::Vector3i step(x, y, z); step.cwiseAbs().sum() == 1 || step.cwiseAbs().sum() == 2)
          steps.push_back(step);
  return steps;
}

std::vector<BrickBits> fully_observed_cells(Bricks known, std::size_t own) {
  const auto index = index_of(known);
  std::vector<BrickBits> cells;
  cells.reserve(known.size());
  for (const auto& [brick, bits] : known) cells.push_back(bits);
  // Separable erosion: along each axis, keeps a voxel only if its upper neighbor is set.
  for (int axis = 2; axis >= 0; --axis) {
    const std::vector<BrickBits> before = cells;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      Eigen::Vector3i next = known[i].first;
      ++next[axis];
      const auto it = index.find(key(next));
      static constexpr BrickBits kNothing{};
      const BrickBits& beyond = it == index.end() ? kNothing : before[it->second];
      for (std::size_t x = 0; x < 8; ++x) {
        const std::uint64_t w = before[i][x];
        cells[i][x] &= axis == 2   ? (w >> 1 & ~kLastZ) | (beyond[x] & kFirstZ) << 7
                       : axis == 1 ? w >> 8 | beyond[x] << 56
                       : x < 7     ? before[i][x + 1]
                                   : beyond[0];
      }
    }
  }
  cells.resize(own);
  return cells;
}

std::vector<Eigen::Vector3i> upper_corners() {
  std::vector<Eigen::Vector3i> steps;
  for (int corner = 1; corner < 8; ++corner) steps.emplace_back(corner & 1, corner >> 1 & 1, corner >> 2);
  return steps;
}

}  // namespace cairn
