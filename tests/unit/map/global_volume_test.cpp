// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/global_volume.hpp"

#include <gtest/gtest.h>

#include "support/device.hpp"
#include "support/volumes.hpp"
#include "volume/polygonize.hpp"

namespace cairn {
namespace {

const FuseOptions kOptions{.voxel_size = 0.02f, .truncation = 0.08f, .device_memory = 96 << 20};
const Eigen::Vector3f kCenter(0.1f, -0.05f, 0.02f);
constexpr float kRadius = 0.4f;  // meters

std::shared_ptr<const BrickTree> sphere() {
  return std::make_shared<const BrickTree>(
      distance_bricks(kOptions, kCenter.array() - 0.55f, kCenter.array() + 0.55f,
                      [](const Eigen::Vector3f& p) { return (p - kCenter).norm() - kRadius; }));
}

/// Keyframes around the sphere, one per submap.
Atlas atlas_of(std::size_t submaps) {
  Atlas atlas;
  for (std::size_t k = 0; k < submaps; ++k) {
    Keyframe keyframe{.timestamp = static_cast<double>(k), .submap = k, .follows = k > 0};
    keyframe.submap_from_camera.translation() = Eigen::Vector3d(0.1 * static_cast<double>(k), 0, -1);
    atlas.add(keyframe);
  }
  return atlas;
}

std::vector<Brick> update(GlobalVolume& world, const Atlas& atlas,
                          const std::vector<std::shared_ptr<const BrickTree>>& trees) {
  std::vector<PlacedSubmap> placed;
  for (std::size_t s = 0; s < trees.size(); ++s)
    placed.push_back({s, std::make_shared<const BrickSet>(trees[s]->bricks()), Deformation(atlas, s)});
  return world.update(
      placed, [&](std::size_t s, const BrickBox&) { return trees[s]; }, [&](std::size_t s) { return trees[s]; });
}

Mesh mesh_of(GlobalVolume& world) {
  Volume volume(test_device(), kOptions, 5.0f);
  volume.adopt(world.release());
  return Polygonizer(test_device()).polygonize(volume);
}

TEST(GlobalVolumeChunks, EqualTheGlobalVolume) {
  // Two submaps, one moved.
  Atlas atlas = atlas_of(2);
  atlas.world_from_camera[1].translate(Eigen::Vector3d(0.03, 0.02, 0.01));
  const auto tree = sphere();
  GlobalVolume world(test_device(), kOptions);
  (void)update(world, atlas, {tree, tree});
  std::vector<PlacedSubmap> placed;
  for (const std::size_t s : {0u, 1u})
    placed.push_back({s, std::make_shared<const BrickSet>(tree->bricks()), Deformation(atlas, s)});
  GlobalVolumeChunks chunks(test_device(), kOptions, placed);
  const std::vector<Brick> all = chunks.bricks();
  std::size_t compared = 0;
  for (const auto& some : {std::span(all).first(all.size() / 3), std::span(all).subspan(all.size() / 3)}) {
    const BrickTree made = chunks.make(some, [&](std::size_t, const BrickBox&) { return tree; });
    EXPECT_LE(made.size(), some.size());
    for (const Brick& brick : some) {
      const std::uint64_t *a = world.bricks().find(brick), *b = made.find(brick);
      ASSERT_EQ(a == nullptr, b == nullptr);
      if (a == nullptr) continue;
      ASSERT_TRUE(std::equal(a, a + 512, b));
      ++compared;
    }
  }
  EXPECT_EQ(compared, world.bricks().size());
}

TEST(GlobalVolume, CopiesAnUnmovedSubmapExactly) {
  GlobalVolume world(test_device(), kOptions);
  const auto tree = sphere();
  const auto made = update(world, atlas_of(1), {tree});
  EXPECT_EQ(made, tree->bricks());
  for (const Brick& brick : made)
    for (std::size_t i = 0; i < 512; ++i) {
      const std::uint64_t was = tree->find(brick)[i], now = world.bricks().find(brick)[i];
      ASSERT_EQ(was, now);
    }
}

TEST(GlobalVolume, TransformsASurfaceWithItsSubmap) {
  GlobalVolume world(test_device(), kOptions);
  Atlas atlas = atlas_of(1);
  Vector6d motion;
  motion << 0.2, -0.5, 0.1, 0.313, -0.127, 0.055;
  const Eigen::Isometry3d move = retract(motion);
  atlas.world_from_camera[0] = move * atlas.world_from_camera[0];
  (void)update(world, atlas, {sphere()});
  const Mesh mesh = mesh_of(world);
  ASSERT_GT(mesh.triangles.size(), 3000u);
  const Eigen::Vector3f center = (move * kCenter.cast<double>()).cast<float>();
  // Twice a linear interpolation over 2 cm: h^2 / 8r = 0.13 mm each, along a diagonal three times as much.
  for (const auto& p : mesh.positions) ASSERT_NEAR((p - center).norm(), kRadius, 6e-4f);
}

TEST(GlobalVolume, AveragesOverlappingSubmaps) {
  GlobalVolume world(test_device(), kOptions);
  Atlas atlas = atlas_of(2);
  for (Keyframe& keyframe : atlas.keyframes) keyframe.follows = false;  // each moves independently
  atlas.world_from_camera[0].translation().x() -= 0.003;
  atlas.world_from_camera[1].translation().x() += 0.003;
  const auto tree = sphere();
  (void)update(world, atlas, {tree, tree});
  for (const auto& p : mesh_of(world).positions) ASSERT_NEAR((p - kCenter).norm(), kRadius, 6e-4f);
}

TEST(GlobalVolume, UpdatesOnlyMovedBricks) {
  GlobalVolume world(test_device(), kOptions);
  Atlas atlas = atlas_of(2);
  for (Keyframe& keyframe : atlas.keyframes) keyframe.follows = false;
  const auto tree = sphere();
  atlas.world_from_camera[1].translation().y() += 2;  // far from the first
  (void)update(world, atlas, {tree, tree});
  EXPECT_TRUE(update(world, atlas, {tree, tree}).empty());
  atlas.world_from_camera[0].translation().x() += 0.1 * kOptions.voxel_size;
  EXPECT_TRUE(update(world, atlas, {tree, tree}).empty());
  atlas.world_from_camera[0].translation().x() += 3;
  const auto made = update(world, atlas, {tree, tree});
  ASSERT_FALSE(made.empty());
  for (const Brick& brick : made) ASSERT_LT(brick.y() * 0.16, 1.0);  // none of the second submap's
  // The first submap has left its old place completely.
  for (const Brick& brick : tree->bricks()) ASSERT_EQ(world.bricks().find(brick), nullptr);
  EXPECT_FALSE(update(world, atlas, {tree}).empty());
  EXPECT_EQ(world.bricks().size(), made.size() - tree->size());
}

TEST(Deformation, InterpolatesACorrectionWithoutASeam) {
  Atlas atlas;
  constexpr std::size_t kKeyframes = 60;
  for (std::size_t k = 0; k < kKeyframes; ++k) {
    Keyframe keyframe{.timestamp = static_cast<double>(k), .submap = k / 20, .follows = k > 0};
    keyframe.submap_from_camera.translation().x() = 0.12 * static_cast<double>(k);
    atlas.add(keyframe);
    // The end of the path moves aside by 20 cm and turns by 3 degrees.
    const double share = static_cast<double>(k) / kKeyframes;
    Vector6d motion;
    motion << 0, 0.05 * share, 0, 0, 0, 0.2 * share;
    atlas.world_from_camera[k] = retract(motion) * keyframe.submap_from_camera;
  }
  const Deformation submaps[3] = {{atlas, 0}, {atlas, 1}, {atlas, 2}};
  double widest = 0, steepest = 0;
  for (double x = 0; x < 7; x += 0.02) {
    const Eigen::Vector3d p(x, 0.3, 1.2), q(x + 0.02, 0.3, 1.2);
    // Continuity of neighboring points: no step much larger than the bend itself, 0.1 m per meter at its end.
    const auto& s = submaps[std::min(2, static_cast<int>(x / 2.4))];
    steepest = std::max(steepest, std::abs((s(q) * q - s(p) * p).norm() - 0.02) / 0.02);
    // At the border of two submaps, both deformations agree.
    if (std::abs(x - 0.12 * 20) < 0.1) widest = std::max(widest, (submaps[0](p) * p - submaps[1](p) * p).norm());
    if (std::abs(x - 0.12 * 40) < 0.1) widest = std::max(widest, (submaps[1](p) * p - submaps[2](p) * p).norm());
  }
  EXPECT_LT(widest, 0.01);
  EXPECT_LT(steepest, 0.15);
}

TEST(GlobalVolume, HasNoGapBetweenVoxelsAndFreeSpaceOfRotatedSubmaps) {
  const FuseOptions fuse;
  BrickTree tree = distance_bricks(fuse, {-0.8f, -0.8f, -0.04f}, {0.8f, 0.8f, 0.04f},
                                   [](const Eigen::Vector3f& p) { return -p.z(); });
  for (int x = -10; x < 10; ++x)
    for (int y = -10; y < 10; ++y)
      for (int z = -8; z < -1; ++z) tree.mark_free({x, y, z});
  const auto submap = std::make_shared<const BrickTree>(std::move(tree));
  Atlas atlas;
  Keyframe keyframe{.timestamp = 0.0, .submap = 0};
  keyframe.submap_from_camera.translation() = Eigen::Vector3d(0, 0, -0.5);
  keyframe.odometry_from_camera = keyframe.submap_from_camera;
  atlas.add(keyframe);
  const Eigen::Isometry3d turn(Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.3, 1, 0.5).normalized()));
  atlas.world_from_camera[0] = turn * atlas.world_from_camera[0];
  GlobalVolume world(test_device(), fuse);
  const std::vector<PlacedSubmap> placed{
      {0, std::make_shared<const BrickSet>(submap->bricks()), Deformation(atlas, 0)}};
  const auto made = world.update(
      placed, [&](std::size_t, const BrickBox&) { return submap; }, [&](std::size_t) { return submap; });
  EXPECT_TRUE(std::is_sorted(made.begin(), made.end(), before));
  int known = 0, samples = 0;
  for (float x = -0.4f; x < 0.4f; x += 0.05f)
    for (float y = -0.4f; y < 0.4f; y += 0.05f)
      for (float z = -0.5f; z < 0.02f; z += 0.013f) {
        const Eigen::Vector3d p = turn * Eigen::Vector3f(x, y, z).cast<double>() / 0.01;
        const Eigen::Vector3i voxel = p.array().round().cast<int>();
        const Brick brick = voxel.unaryExpr([](int i) { return i >> 3; });
        const std::uint64_t* voxels = world.bricks().find(brick);
        const auto at = static_cast<std::size_t>((voxel.x() & 7) << 6 | (voxel.y() & 7) << 3 | (voxel.z() & 7));
        known += (voxels != nullptr && ((voxels[at] >> 16) & 0xffff) != 0) ||
                 (world.bricks().free_voxels(brick)[at >> 6] >> (at & 63) & 1) != 0;
        ++samples;
      }
  EXPECT_GT(known, 0.995 * samples);
  // Free space creates no surface.
  Volume global_volume(test_device(), fuse, 5.0f);
  global_volume.adopt(world.release());
  const Mesh mesh = Polygonizer(test_device()).polygonize(global_volume);
  ASSERT_GT(mesh.triangles.size(), 1000u);
  for (const auto& p : mesh.positions) EXPECT_NEAR((turn.inverse() * p.cast<double>()).z(), 0.0, 0.002);
}

}  // namespace
}  // namespace cairn
