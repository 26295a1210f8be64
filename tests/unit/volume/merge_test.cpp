// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/merge.hpp"

#include <gtest/gtest.h>

#include <random>

#include "cairn/mapping/pose.hpp"
#include "support/device.hpp"
#include "support/twins.hpp"

namespace cairn {
namespace {

/// Bricks around the origin with random voxels; some bricks are missing.
std::shared_ptr<const BrickTree> random_bricks(unsigned seed) {
  std::mt19937 random(seed);
  BrickTree tree;
  for (int x = -2; x <= 2; ++x)
    for (int y = -2; y <= 2; ++y)
      for (int z = -2; z <= 2; ++z) {
        BrickVoxels voxels;
        for (auto& v : voxels)
          v = (random() & 0xffff) | std::uint64_t{256 + random() % 4096} << 16 |
              std::uint64_t{random() & 0xffffff} << 32 | std::uint64_t{1 + random() % 20} << 56;
        if (random() % 5 != 0) tree.put({x, y, z}, voxels);
      }
  return std::make_shared<const BrickTree>(std::move(tree));
}

TEST(Merge, EqualsItsPlainTwin) {
  const FuseOptions options;
  const std::vector<std::shared_ptr<const BrickTree>> trees{random_bricks(1), random_bricks(2), random_bricks(3)};
  std::vector<std::pair<const BrickTree*, Eigen::Isometry3d>> submaps;
  MergeJob job{.target = {0, -1, 0}, .shares = {}};
  for (std::size_t i = 0; i < trees.size(); ++i) {
    Vector6d motion;
    motion << 0.3 * static_cast<double>(i), -0.2, 0.7 * static_cast<double>(i), 0.0137, -0.0211, 0.0072;
    submaps.emplace_back(trees[i].get(), retract(motion));
    job.shares.push_back({i, submaps.back().second});
  }
  BrickTree world;
  Merger(test_device(), options)
      .merge(
          std::span(&job, 1), [&](std::size_t i, const BrickBox&) { return trees[i]; }, world);
  ASSERT_EQ(world.size(), 1u);
  const std::uint64_t* merged = world.find(job.target);
  int observed = 0, colors = 0;
  for (int i = 0; i < 512; ++i) {
    const Eigen::Vector3i voxel = 8 * job.target + Eigen::Vector3i(i >> 6, (i >> 3) & 7, i & 7);
    const twin::Voxel expected = twin::merge(voxel, submaps, options);
    const std::uint64_t v = merged[i];
    const auto weight = static_cast<double>(shader::voxel_weight(v));
    // Positions are computed in 32 bits, and noise has the largest gradient: 1e-5 voxels times the difference of two
    // neighbors.
    ASSERT_NEAR(weight, expected.weight, 0.02) << i;
    ASSERT_NEAR(static_cast<double>(shader::voxel_distance(v)), expected.distance, 2e-3) << i;
    observed += weight > 0;
    bool same = true;
    for (int c = 0; c < 3; ++c)
      same = same &&
             std::abs(static_cast<double>((v >> (32 + 8 * c)) & 0xff) - static_cast<double>(expected.color[c])) <= 1;
    colors += same;
  }
  EXPECT_GT(observed, 300);
  EXPECT_GE(colors, 510);  // a point half way between two voxels may take either's color
}

TEST(Merge, ErasesUnobservedBricks) {
  const auto tree = random_bricks(1);
  BrickTree world;
  const BrickVoxels old{1, 2, 3};
  const MergeJob job{.target = {40, 0, 0}, .shares = {{0, Eigen::Isometry3d::Identity()}}};
  world.put(job.target, old);
  Merger(test_device(), {})
      .merge(
          std::span(&job, 1), [&](std::size_t, const BrickBox&) { return tree; }, world);
  EXPECT_EQ(world.size(), 0u);
}

}  // namespace
}  // namespace cairn
