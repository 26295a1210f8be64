// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Observed free space, voxel by voxel.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "preprocess/preprocess.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"
#include "support/twins.hpp"
#include "support/volumes.hpp"
#include "volume/esdf.hpp"
#include "volume/integrate.hpp"
#include "volume/vdb/brick_file.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {
namespace {

const FuseOptions kFuse;

std::size_t voxel_in(const Eigen::Vector3i& v) {
  return static_cast<std::size_t>((v.x() & 7) << 6 | (v.y() & 7) << 3 | (v.z() & 7));
}
/// True if the voxel nearest to a point is free, or observed in front of a surface.
bool is_free(const BrickTree& map, const Eigen::Vector3d& p) {
  const Eigen::Vector3i voxel = (p / static_cast<double>(kFuse.voxel_size)).array().round().cast<int>();
  const Brick brick = voxel.unaryExpr([](int i) { return i >> 3; });
  const std::size_t at = voxel_in(voxel);
  const std::uint64_t* voxels = map.find(brick);
  if (voxels != nullptr && shader::voxel_weight(voxels[at]) > 0) return shader::voxel_distance(voxels[at]) > 0;
  return (map.free_voxels(brick)[at >> 6] >> (at & 63) & 1) != 0;
}

/// Wall at 3 m, filling the image, with a pillar of 20 cm in front.
Scene pillar_before_a_wall() {
  Scene scene;
  scene.solids.push_back({.center = {0, 0, 3.5f}, .half_size = {6, 6, 0.5f}});
  scene.solids.push_back({.shape = Scene::Shape::cylinder, .center = {0, 0, 1.5f}, .half_size = {0.1f, 3, 0.1f}});
  return scene;
}

/// One fused frame, with the resulting map.
struct SingleView {
  Camera camera = small_camera();
  Preprocessor preprocessor{test_device(), camera, {}, 1, 0};
  Volume volume{test_device(), kFuse, 5.0f};
  IntegrationResult fused;
  std::vector<float> depth;  // as fused
  Eigen::Isometry3d pose;
  explicit SingleView(const Frame& frame, float camera_radius = 0) : pose(*frame.world_from_camera) {
    Integrator integrator(test_device(), camera, {}, {}, camera_radius);
    const FramePyramid surface = preprocessor.preprocess(frame);
    fused = integrator.integrate(surface, pose, volume, 1);
    for (const auto& pixel : download<shader::uvec2>(*surface.fusion, frame.depth.size()))
      depth.push_back(std::bit_cast<float>(pixel.x));
  }
  const BrickTree& map() { return volume.on_host(); }
};

TEST(FreeSpace, EqualsItsPlainTwin) {
  SingleView view(scene_frame(synthetic_scene("room"), small_camera(), 0, true));
  ASSERT_GT(view.fused.newly_free.size(), 3000u);
  EXPECT_TRUE(std::is_sorted(view.fused.newly_free.begin(), view.fused.newly_free.end(), before));
  Eigen::AlignedBox3i box;
  for (const Brick& brick : view.fused.newly_free) box.extend(brick);
  std::size_t bits = 0, different = 0, parts = 0;
  for (int x = box.min().x() - 1; x <= box.max().x() + 1; ++x)
    for (int y = box.min().y() - 1; y <= box.max().y() + 1; ++y)
      for (int z = box.min().z() - 1; z <= box.max().z() + 1; ++z) {
        if ((x + 3 * y + 5 * z) % 11 != 0) continue;  // the reference implementation is slow
        const Brick brick(x, y, z);
        const BrickBits found = view.volume.host().free_voxels(brick);
        if (view.volume.slot_of(brick) != Volume::kNoSlot && found == kNoBits) continue;  // was fused
        const BrickBits expected = twin::free_voxels(brick, view.depth, view.camera, view.pose, kFuse);
        parts += found != kNoBits && found != kAllBits;
        for (std::size_t w = 0; w < found.size(); ++w) {
          bits += static_cast<std::size_t>(std::popcount(expected[w]));
          different += static_cast<std::size_t>(std::popcount(expected[w] ^ found[w]));
        }
      }
  EXPECT_GT(parts, 90u);
  EXPECT_GT(bits, 100000u);
  EXPECT_LT(different, bits / 10000);  // a voxel projected onto the border of two pixels may use either
}

TEST(FreeSpace, ExtendsFromTheCameraToTheSurface) {
  const Scene scene = synthetic_scene("room");
  SingleView view(scene_frame(scene, small_camera(), 0));
  const BrickTree& map = view.map();
  int free = 0, samples = 0, claimed = 0, behind = 0;
  for (int v = 3; v < 237; v += 6)
    for (int u = 3; u < 317; u += 6) {
      const float z = view.depth[static_cast<std::size_t>(v * view.camera.width + u)];
      if (z == 0) continue;
      const Eigen::Vector3d ray((u - view.camera.cx) / view.camera.fx, (v - view.camera.cy) / view.camera.fy, 1.0);
      // From the camera itself, below its minimum depth, up to the start of the truncation.
      for (double at = 0.02; at < static_cast<double>(z - kFuse.truncation); at += 0.05, ++samples)
        free += is_free(map, view.pose * (at * ray));
      for (double at = static_cast<double>(z) + 0.02; at < static_cast<double>(z) + 0.5; at += 0.05) {
        if (scene.distance(view.pose * (at * ray)) > -0.015) continue;  // beside an edge other rays pass
        claimed += is_free(map, view.pose * (at * ray));
        ++behind;
      }
    }
  ASSERT_GT(samples, 50000);
  ASSERT_GT(behind, 1000);
  EXPECT_GT(free, 0.99 * samples);  // rays beside a nearer edge hit occluded voxels
  EXPECT_EQ(claimed, 0);
}

TEST(FreeSpace, ExcludesTheShadowOfAPillar) {
  const Scene scene = pillar_before_a_wall();
  SingleView view(scene_frame_at(scene, small_camera(), Eigen::Isometry3d::Identity()));
  const BrickTree& map = view.map();
  // At 2.4 m the shadow is 32 cm wide.
  for (double y = -0.5; y <= 0.5; y += 0.1)
    for (double x = -0.8; x <= 0.8; x += 0.013) {
      if (std::abs(x) >= 0.14 && std::abs(x) <= 0.18) continue;
      EXPECT_EQ(is_free(map, {x, y, 2.4}), std::abs(x) > 0.16) << x << ' ' << y;
    }
}

TEST(FreeSpace, ExcludesPixelsWithoutDepth) {
  Frame frame = scene_frame_at(pillar_before_a_wall(), small_camera(), Eigen::Isometry3d::Identity());
  const Camera camera = small_camera();
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < 100; ++u) frame.depth[static_cast<std::size_t>(v * camera.width + u)] = 0;
  SingleView view(frame);
  const BrickTree& map = view.map();
  for (double z = 0.1; z < 2.8; z += 0.07)
    for (double v = 10; v < 230; v += 20)
      for (const auto& [u, is_measured] : {std::pair{96.0, false}, {104.0, true}}) {
        const Eigen::Vector3d ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
        // The voxel is offset by up to half its size.
        if (0.006 * camera.fx / z >= 4) continue;
        EXPECT_EQ(is_free(map, z * ray), is_measured) << u << ' ' << v << ' ' << z;
      }
}

TEST(FreeSpace, IgnoresASingleWrongPixel) {
  // Measured 1.5 m too far, as at a reflection: the filter keeps such a pixel if it has no valid neighbors.
  const Camera camera = small_camera();
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Frame frame{.depth = std::vector<float>(static_cast<std::size_t>(camera.width * camera.height), 1.5f),
              .color = std::vector<std::uint32_t>(static_cast<std::size_t>(camera.width * camera.height), 0xff808080)};
  const FramePyramid surface = preprocessor.preprocess(frame);
  std::vector<shader::uvec2> pixels = download<shader::uvec2>(*surface.fusion, frame.depth.size());
  for (std::size_t i = 0; i < pixels.size(); i += 1111) pixels[i].x = std::bit_cast<std::uint32_t>(3.0f);
  gpu::Batch batch(test_device());
  batch.upload(*surface.fusion, pixels);
  batch.run();
  Volume volume(test_device(), kFuse, 5.0f);
  (void)Integrator(test_device(), camera, {}).integrate(surface, Eigen::Isometry3d::Identity(), volume, 1);
  const BrickTree& map = volume.on_host();
  for (const Brick& brick : map.free_bricks()) {
    const BrickBits bits = map.free_voxels(brick);
    for (int i = 0; i < 512; ++i)
      if ((bits[static_cast<std::size_t>(i >> 6)] >> (i & 63) & 1) != 0) {
        ASSERT_LT(8 * brick.z() + (i & 7), 150) << brick.transpose();
      }
  }
  EXPECT_GT(map.free_bricks().size(), 1000u);
}

TEST(FreeSpace, CompletesPartlyFreeBricks) {
  Volume volume(test_device(), kFuse, 5.0f);
  Preprocessor preprocessor(test_device(), small_camera(), {}, 1, 0);
  Integrator integrator(test_device(), small_camera(), {});
  const Scene scene = synthetic_scene("room");
  const auto carve = [&](int frame, std::uint32_t count) {
    const Frame f = scene_frame(scene, small_camera(), frame);
    return integrator.integrate(preprocessor.preprocess(f), *f.world_from_camera, volume, count, 1).newly_free;
  };
  const std::vector<Brick> first = carve(0, 1);
  // The same view again adds nothing, and a view from beside it completes partially free bricks.
  EXPECT_TRUE(carve(0, 2).empty());
  std::vector<Brick> parts;
  for (const Brick& brick : first)
    if (volume.host().free_voxels(brick) != kAllBits) parts.push_back(brick);
  const std::size_t before_it = parts.size();
  (void)carve(20, 3);
  std::erase_if(parts, [&](const Brick& brick) { return volume.host().free_voxels(brick) == kAllBits; });
  EXPECT_LT(parts.size(), 0.9 * static_cast<double>(before_it));
  // By default every eighth frame carves free space.
  for (std::uint32_t count = 10; count < 17; ++count) {
    const Frame f = scene_frame(scene, small_camera(), 60);
    EXPECT_TRUE(
        integrator.integrate(preprocessor.preprocess(f), *f.world_from_camera, volume, count).newly_free.empty());
  }
}

TEST(FreeSpace, IncludesTheBallAroundTheCamera) {
  const Eigen::Vector3d center(3.3, -20.7, 100.2);
  const double radius = 9.4;
  const BrickMarks marks = ball(center, radius);
  BrickTree tree;
  for (std::size_t i = 0; i < marks.bricks.size(); ++i) EXPECT_TRUE(tree.mark_free(marks.bricks[i], marks.voxels[i]));
  int inside = 0;
  for (int x = -20; x < 30; ++x)
    for (int y = -40; y < 10; ++y)
      for (int z = 80; z < 120; ++z) {
        const Eigen::Vector3i voxel(x, y, z);
        const std::size_t at = voxel_in(voxel);
        const BrickBits bits = tree.free_voxels(voxel.unaryExpr([](int i) { return i >> 3; }));
        const bool is_in = (voxel.cast<double>() - center).norm() <= radius;
        ASSERT_EQ((bits[at >> 6] >> (at & 63) & 1) != 0, is_in) << voxel.transpose();
        inside += is_in;
      }
  EXPECT_NEAR(inside, 4.19 * std::pow(radius, 3), 60);
  EXPECT_TRUE(ball(center, 0.1).bricks.empty());  // contains no voxel center

  SingleView view(scene_frame(synthetic_scene("room"), small_camera(), 0), 0.2f);
  const BrickTree& map = view.map();
  for (const Eigen::Vector3d& aside : {Eigen::Vector3d(0, 0, -0.18), Eigen::Vector3d(0.18, 0, 0),
                                       Eigen::Vector3d(0, -0.18, 0), Eigen::Vector3d(0, 0, 0)})
    EXPECT_TRUE(is_free(map, view.pose * aside)) << aside.transpose();
  EXPECT_FALSE(is_free(map, view.pose * Eigen::Vector3d(0, 0, -0.23)));
}

TEST(FreeSpace, RoundTripsThroughFiles) {
  BrickTree tree =
      distance_bricks(kFuse, {0, 0, 0}, {0.1f, 0.1f, 0.1f}, [](const Eigen::Vector3f& p) { return 0.05f - p.z(); });
  const BrickBits some{0, 1, 0xffull << 40, 0, 7, 0, 0, 1ull << 63};
  EXPECT_TRUE(tree.mark_free({-7, 3, 2}));
  EXPECT_TRUE(tree.mark_free({-7, 3, 3}, some));
  EXPECT_FALSE(tree.mark_free({-7, 3, 3}, {0, 1}));
  EXPECT_FALSE(tree.mark_free({-7, 3, 2}, some));
  EXPECT_FALSE(tree.mark_free({5, 5, 5}, kNoBits));
  EXPECT_TRUE(tree.mark_free({40, -100, 7}));
  EXPECT_TRUE(tree.mark_free({0, 0, 0}, some));  // has voxels, which stay
  const std::vector<Brick> free{{-7, 3, 2}, {-7, 3, 3}, {0, 0, 0}, {40, -100, 7}};
  EXPECT_EQ(tree.free_bricks(), free);
  EXPECT_TRUE(tree.is_free({-7, 3, 2}));
  EXPECT_FALSE(tree.is_free({-7, 3, 3}));
  EXPECT_NE(tree.find({0, 0, 0}), nullptr);
  const TemporaryFolder folder;
  write_grids(folder / "map.vdb", tree, {.voxel_size = 0.01f, .truncation = 0.04f});
  write_bricks(folder / "bricks.vdb", tree);
  const BrickFile file(folder / "bricks.vdb");
  const BrickTree copy = tree.copy(), map = read_grids(folder / "map.vdb").tree, all = file.read(),
                  marks = file.read_free();
  for (const BrickTree* read : {&copy, &map, &all, &marks}) {
    EXPECT_EQ(read->free_bricks(), free);
    for (const Brick& brick : free) EXPECT_EQ(read->free_voxels(brick), tree.free_voxels(brick));
  }
  EXPECT_EQ(marks.size(), 0u);
  EXPECT_EQ(all.size(), tree.size());
  EXPECT_EQ(map.size(), tree.size());
  // In a range of the file, completely free bricks.
  const BrickTree part = file.read(BrickBox(Brick(-8, 0, 0), Brick(0, 5, 5)));
  EXPECT_EQ(part.free_bricks(), (std::vector<Brick>{{-7, 3, 2}}));
  EXPECT_NE(part.find({0, 0, 0}), nullptr);

  BrickTree other;
  other.mark_free({1, 1, 1}, some);
  BrickTree taken = tree.copy();
  taken.take_free(std::move(other));
  EXPECT_EQ(taken.free_bricks(), (std::vector<Brick>{{1, 1, 1}}));
  EXPECT_EQ(taken.size(), tree.size());
  taken.forget_free();
  EXPECT_TRUE(taken.free_bricks().empty());
  EXPECT_EQ(tree.free_bricks(), free);
}

/// A floor and a ball of free voxels above it.
BrickTree ball_over_a_floor(double radius) {
  BrickTree tree = distance_bricks(kFuse, {-0.6f, 0.4f, -0.6f}, {0.6f, 0.6f, 0.6f},
                                   [](const Eigen::Vector3f& p) { return 0.5f - p.y(); });
  const BrickMarks marks = ball({0, 10, 0}, radius);
  for (std::size_t i = 0; i < marks.bricks.size(); ++i) tree.mark_free(marks.bricks[i], marks.voxels[i]);
  return tree;
}

TEST(FreeSpace, IsObservedInTheDistanceFieldAtEveryScale) {
  const BrickTree tree = ball_over_a_floor(20);
  for (const int scale : {1, 2, 4, 8}) {
    const float voxel = static_cast<float>(scale) * kFuse.voxel_size;
    const auto field = distances_of(test_device(), tree, kFuse, {.voxel_size = voxel});
    int known = 0, free = 0;
    for (const auto& [block, samples] : field->blocks())
      for (int i = 0; i < 4096; ++i) {
        const Eigen::Vector3f p = field->origin() + voxel * DistanceField::voxel(block, i).cast<float>();
        if (p.y() > 0.35f) continue;
        // Free if all corresponding voxels of the map are free; at the finest scale the voxels of the cell behind it.
        // With many voxels, half of the cells are sufficient, as for observed cells.
        bool is_known = true;
        const Eigen::Vector3i first = DistanceField::voxel(block, i) * scale;
        for (int k = 0; k < std::max(scale, 2) * std::max(scale, 2) * std::max(scale, 2); ++k) {
          const int side = std::max(scale, 2);
          Eigen::Vector3i low = first;
          if (scale == 1) low = low.unaryExpr([](int v) { return (v & 7) == 7 ? v - 1 : v; });
          const Eigen::Vector3i v = low + Eigen::Vector3i(k / side / side, k / side % side, k % side);
          is_known = is_known && (v.cast<double>() - Eigen::Vector3d(0, 10, 0)).norm() <= 20;
        }
        const float d = (*samples)[static_cast<std::size_t>(i)];
        if (scale > 2) {
          ASSERT_TRUE(!is_known || !std::isnan(d)) << scale << ": " << p.transpose();
        } else {
          ASSERT_EQ(!std::isnan(d), is_known) << scale << ": " << p.transpose();
        }
        known += !std::isnan(d);
        free += is_known;
        if (!is_known || std::isnan(d)) continue;
        ASSERT_NEAR(d, 0.5f - p.y(), 0.02f * static_cast<float>(scale)) << p.transpose();
      }
    EXPECT_GE(known, free);
    EXPECT_GT(free, scale == 8 ? 0 : 15000 / scale / scale / scale);
  }
}

TEST(FreeSpace, OfABrickWithVoxelsIsObservedOrCarved) {
  // Half of the brick was observed in front of a wall elsewhere, the other half was passed by a ray.
  BrickTree tree = distance_bricks(kFuse, {0, 0, 0.2f}, {0.07f, 0.07f, 0.27f},
                                   [](const Eigen::Vector3f& p) { return 0.25f - p.z(); });
  BrickVoxels voxels{};
  BrickBits bits{};
  for (int i = 0; i < 512; ++i)
    if ((i & 7) < 3)
      bits[static_cast<std::size_t>(i >> 6)] |= 1ull << (i & 63);
    else
      voxels[static_cast<std::size_t>(i)] = shader::pack_voxel(1, 2);
  tree.put({0, 0, 0}, voxels);
  const auto observed_in = [&](const BrickTree& map) {
    int known = 0;
    const auto field = distances_of(test_device(), map, kFuse, {});
    for (const auto& [block, samples] : field->blocks())
      for (int i = 0; i < 4096; ++i) {
        const Eigen::Vector3i v = DistanceField::voxel(block, i);
        known +=
            (v.array() >= 0).all() && (v.array() < 4).all() && !std::isnan((*samples)[static_cast<std::size_t>(i)]);
      }
    return known;
  };
  EXPECT_EQ(observed_in(tree), 32);  // two of four layers
  tree.mark_free({0, 0, 0}, bits);
  EXPECT_EQ(observed_in(tree), 64);
}

TEST(FreeSpace, DoesNotChangeDistances) {
  const Scene scene = synthetic_scene("room");
  SingleView view(scene_frame(scene, small_camera(), 0, true));
  BrickTree without = view.map().copy();
  without.forget_free();
  BrickTree all = without.copy();  // in the same blocks
  for (const Brick& brick : all.bricks()) all.mark_free(brick);
  for (const float voxel : {0.01f, 0.02f}) {
    const auto a = distances_of(test_device(), without, kFuse, {.voxel_size = voxel}),
               b = distances_of(test_device(), all, kFuse, {.voxel_size = voxel});
    int compared = 0;
    for (const auto& [block, samples] : a->blocks())
      for (int i = 0; i < 4096; i += 3) {
        const float d = (*samples)[static_cast<std::size_t>(i)];
        if (std::isnan(d)) continue;
        const Eigen::Vector3f p = a->origin() + voxel * DistanceField::voxel(block, i).cast<float>();
        ASSERT_NEAR(b->query(p).distance, d, 1e-4f) << p.transpose();
        ++compared;
      }
    EXPECT_GT(compared, 10000);
  }
}

TEST(FreeSpace, IncludesABallAroundEachVisitedPose) {
  const BrickTree tree = ball_over_a_floor(3);
  Trajectory visited;
  for (int i = 0; i < 60; ++i) {
    visited.emplace_back().timestamp = i;
    visited.back().world_from_camera.translation() = Eigen::Vector3d(0.05 * i - 1.5, -0.2, 0.1);
  }
  for (const auto& [scale, radius] : {std::pair{2, 0.1f}, {4, 0.02f}, {8, 0.1f}}) {
    const EsdfOptions options{.voxel_size = static_cast<float>(scale) * kFuse.voxel_size, .robot_radius = radius};
    const auto field = distances_of(test_device(), tree, kFuse, options, visited);
    for (const StampedPose& pose : visited) {
      const auto answer = field->query(pose.world_from_camera.translation().cast<float>());
      ASSERT_TRUE(answer.known) << scale << ": " << pose.timestamp;
      if (std::abs(pose.world_from_camera.translation().x()) > 0.4) continue;
      EXPECT_NEAR(answer.distance, 0.7f, 0.03f);
    }
    EXPECT_FALSE(field->query({-0.5f, -0.2f, 0.5f}).known);
    EXPECT_FALSE(distances_of(test_device(), tree, kFuse, options)->query({-0.5f, -0.2f, 0.1f}).known);
  }
}

}  // namespace
}  // namespace cairn
