// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/observed_space.hpp"

#include <algorithm>
#include <limits>

#include "shaders/voxel.h"

namespace cairn {
namespace {

constexpr int kSide = 24;  // voxels along the side of three bricks
constexpr int kMaxSquaredDistance = std::numeric_limits<std::int16_t>::max() / 2;

enum class Space : std::uint8_t { unknown, free, behind };  // behind: behind a surface

/// Values for the voxels of a brick and its 26 neighbors.
template <class T>
using Around = std::vector<T>;

std::size_t index(int x, int y, int z) { return static_cast<std::size_t>((x * kSide + y) * kSide + z); }

Around<Space> gather(const BrickTree& tree, const BrickTree& free, const Eigen::Vector3i& brick) {
  Around<Space> space(kSide * kSide * kSide, Space::unknown);
  for (int k = 0; k < 27; ++k) {
    const Eigen::Vector3i at(k / 9, k / 3 % 3, k % 3), b = brick + at - Eigen::Vector3i::Ones();
    const std::uint64_t* voxels = tree.find(b);
    const BrickBits bits = free.free_voxels(b);
    if (voxels == nullptr && bits == kNoBits) continue;
    for (int i = 0; i < 512; ++i) {
      Space& s = space[index(8 * at.x() + (i >> 6), 8 * at.y() + (i >> 3 & 7), 8 * at.z() + (i & 7))];
      const auto v = static_cast<std::size_t>(i);
      if (voxels != nullptr && shader::voxel_weight(voxels[v]) > 0)
        s = shader::voxel_distance(voxels[v]) > 0 ? Space::free : Space::behind;
      else if ((bits[v / 64] >> (v % 64) & 1) != 0)
        s = Space::free;
    }
  }
  return space;
}

/// Squared distances in voxels to the nearest voxel behind a surface, for the center brick, up to `reach`. Separable:
/// processes the axes in turn (Felzenszwalb & Huttenlocher 2012; brute force per axis because `reach` is short).
Around<std::int16_t> distances(const Around<Space>& space, int reach) {
  Around<std::int16_t> d(space.size());
  for (std::size_t i = 0; i < d.size(); ++i)
    d[i] = space[i] == Space::behind ? std::int16_t{0} : std::int16_t{kMaxSquaredDistance};
  const std::array<std::size_t, 3> stride{1, kSide, kSide * kSide};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Around<std::int16_t> next(d.size(), std::int16_t{kMaxSquaredDistance});
    // Axes already processed are needed in the center brick only.
    const auto begin = [&](std::size_t a) { return a <= axis ? 8 : 0; };
    const auto end = [&](std::size_t a) { return a <= axis ? 16 : kSide; };
    for (int x = begin(2); x < end(2); ++x)
      for (int y = begin(1); y < end(1); ++y)
        for (int z = begin(0); z < end(0); ++z) {
          const std::size_t at = index(x, y, z);
          int min_squared = kMaxSquaredDistance;
          for (int k = -reach; k <= reach; ++k)
            min_squared = std::min(min_squared, d[at + static_cast<std::size_t>(k) * stride[axis]] + k * k);
          next[at] = static_cast<std::int16_t>(std::min(min_squared, kMaxSquaredDistance));
        }
    d = std::move(next);
  }
  return d;
}

bool is_free_around(const Around<Space>& space, int x, int y, int z) {
  for (int k = 0; k < 27; ++k)
    if (space[index(x + k / 9 - 1, y + k / 3 % 3 - 1, z + k % 3 - 1)] != Space::free) return false;
  return true;
}

}  // namespace

ObservedSpace observed_space(const BrickTree& voxels, const BrickTree& free, const Eigen::Vector3i& brick, int reach) {
  const Around<Space> space = gather(voxels, free, brick);
  const Around<std::int16_t> behind = distances(space, reach);
  ObservedSpace observed;
  for (int i = 0; i < 512; ++i) {
    const int x = 8 + (i >> 6), y = 8 + (i >> 3 & 7), z = 8 + (i & 7);
    const std::uint64_t bit = 1ull << (i & 63);
    const auto word = static_cast<std::size_t>(i >> 6);
    if (space[index(x, y, z)] != Space::unknown) observed.observed[word] |= bit;
    if (behind[index(x, y, z)] > reach * reach && is_free_around(space, x, y, z)) observed.clear[word] |= bit;
  }
  return observed;
}

}  // namespace cairn
