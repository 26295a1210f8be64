// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Maps of exact voxels, without a camera.
#pragma once
#include <algorithm>
#include <cmath>
#include <functional>

#include "shaders/voxel.h"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {

using Distance = std::function<double(const Eigen::Vector3d&)>;  // meters from a point of the world to a surface

struct ExactMap {
  float voxel_size = 0.03f, truncation = 0.09f;  // meters
  Eigen::AlignedBox3d box;                       // of the world: includes bricks with their center inside
  GravityAlignment upright;
  std::function<bool(const Eigen::Vector3d& middle)> is_seen = {};  // by the center of a brick, in the world; none: all
                                                                    // are observed
};

inline GravityAlignment gravity_alignment_of(const Eigen::Quaterniond& world_from_map) {
  return {.source = GravityAlignment::Source::option,
          .known = true,
          .world_from_tracked = world_from_map,
          .description = "given"};
}

/// Exact bricks near surfaces, and free bricks.
inline BrickTree bricks_of(const Distance& distance, const ExactMap& map) {
  const Eigen::Quaterniond& world_from_map = map.upright.world_from_tracked;
  const auto voxel = static_cast<double>(map.voxel_size), size = 8 * voxel, half = size * std::sqrt(3.0) / 2,
             truncation = static_cast<double>(map.truncation);
  Eigen::AlignedBox3d around;  // in the map's frame
  for (int corner = 0; corner < 8; ++corner)
    around.extend(world_from_map.conjugate() * map.box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
  const Eigen::Vector3i low = (around.min() / size).array().floor().cast<int>(),
                        high = (around.max() / size).array().floor().cast<int>();
  BrickTree tree;
  for (int x = low.x(); x <= high.x(); ++x)
    for (int y = low.y(); y <= high.y(); ++y)
      for (int z = low.z(); z <= high.z(); ++z) {
        const Eigen::Vector3d middle = world_from_map * ((Eigen::Vector3d(x, y, z).array() + 0.5).matrix() * size);
        if (!map.box.contains(middle) || (map.is_seen && !map.is_seen(middle))) continue;
        const double d = distance(middle);
        if (d > half + truncation) tree.mark_free({x, y, z});
        if (std::abs(d) > half + truncation) continue;
        BrickVoxels voxels{};
        for (int i = 0; i < 512; ++i) {
          const Eigen::Vector3d p(8 * x + (i >> 6), 8 * y + (i >> 3 & 7), 8 * z + (i & 7));
          const auto at = static_cast<float>(distance(world_from_map * (p * voxel)));
          voxels[static_cast<std::size_t>(i)] =
              shader::pack_voxel(std::clamp(at / map.truncation, -1.0f, 1.0f), 4, 0x01806040);
        }
        tree.put({x, y, z}, voxels);
      }
  return tree;
}

/// Writes a map.vdb.
inline void write_exact_map(const std::filesystem::path& file, const Distance& distance, const ExactMap& map) {
  write_grids(file, bricks_of(distance, map),
              {.voxel_size = map.voxel_size, .truncation = map.truncation, .upright = map.upright});
}

}  // namespace cairn
