// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/back_end.hpp"

#include <gtest/gtest.h>

#include "cairn/pose.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

/// Walks through a scene along its own path with poses that drift slowly, a frame every 0.2 s, in small submaps.
struct Walk {
  Walk(const std::string& name, int frames, double slip, const std::filesystem::path& session = {}) {
    options.map.submap_radius = 1.5f;
    options.session = session;
    back_end.emplace(test_device(), camera, options);
    const Scene scene = synthetic_scene(name);
    SceneRenderer render(test_device(), scene, camera);
    const Matrix6d information = 1e6 * Matrix6d::Identity();
    Vector6d drift;
    drift << 0, slip, 0, slip, 0, slip;
    for (int i = 0; i < frames; ++i) {
      truth.push_back(scene.world_from_camera(0.2 * i));
      auto images = render(truth.back());
      add_kinect_noise(images, camera, 1, i);
      const Frame frame{
          .index = i, .timestamp = 0.2 * i, .depth = std::move(images.depth), .colour = std::move(images.colour)};
      tracked = i == 0 ? truth[0]
                       : tracked * truth[static_cast<std::size_t>(i) - 1].inverse() * truth.back() * exponential(drift);
      back_end->add(frame, tracked, i > 0 ? &information : nullptr, volume, static_cast<std::uint32_t>(i + 1));
    }
    back_end->settle();
  }
  /// Metres between where a loop puts its keyframe and where it is.
  [[nodiscard]] double error(const Loop& loop) const {
    const auto& keyframes = back_end->atlas().keyframes;
    const auto at = [&](std::size_t k) { return truth[static_cast<std::size_t>(keyframes[k].frame)]; };
    return ((at(loop.edge.from).inverse() * at(loop.edge.to)).translation() - loop.edge.from_from_to.translation())
        .norm();
  }
  Camera camera = small_camera();
  Options options;
  Volume volume{test_device(), options.fuse, 5.0f};
  std::optional<BackEnd> back_end;
  std::vector<Eigen::Isometry3d> truth;
  Eigen::Isometry3d tracked = Eigen::Isometry3d::Identity();
};

TEST(BackEnd, FindsTheWayBackAndTakesTheDriftOut) {
  const Walk walk("flat", 230, 0.0004);
  const Atlas& atlas = walk.back_end->atlas();
  ASSERT_GT(atlas.loops.size(), 3u);
  for (const Loop& loop : atlas.loops) {
    EXPECT_LT(walk.error(loop), 0.03);
    EXPECT_GT(loop.edge.to, loop.edge.from + 50);
  }
  const double before = (walk.tracked.translation() - walk.truth.back().translation()).norm();
  const double after = (atlas.world_from_camera.back().translation() -
                        walk.truth[static_cast<std::size_t>(atlas.keyframes.back().frame)].translation())
                           .norm();
  std::printf("%zu submaps, %zu loops, the end is off by %.1f mm, with loops %.1f mm\n",
              walk.back_end->submaps().size(), atlas.loops.size(), 1000 * before, 1000 * after);
  EXPECT_GT(before, 0.1);
  EXPECT_LT(after, 0.3 * before);
  EXPECT_EQ(atlas.pieces(), std::vector<std::size_t>(atlas.keyframes.size(), 0));
}

TEST(BackEnd, IsNotTakenInByARoomThatLooksLikeAnother) {
  const Walk walk("twin-rooms", 215, 0.0003);
  const Atlas& atlas = walk.back_end->atlas();
  // The second room's places are tried as the first's, and refused; back in the first they are found.
  for (const Loop& loop : atlas.loops) EXPECT_LT(walk.error(loop), 0.03);
  EXPECT_GT(atlas.loops.size(), 3u);
}

TEST(BackEnd, KeepsSubmapsOnTheDiskWhenTheyExceedTheBudget) {
  const TemporaryFolder folder;
  std::vector<Brick> bricks;
  Submaps submaps(folder.path(), 1 << 20);  // 256 bricks
  std::vector<BrickTree> originals;
  for (int s = 0; s < 5; ++s) {
    BrickTree tree;
    for (int i = 0; i < 100; ++i) {
      BrickVoxels voxels{};
      voxels[7] = static_cast<std::uint64_t>(1000 * s + i) << 16;
      tree.put({i, s, 0}, voxels);
    }
    originals.push_back(tree.copy());
    submaps.add(std::move(tree));
  }
  submaps.wait();
  EXPECT_EQ(submaps.problem(), "");
  EXPECT_LE(submaps.counts().peak_bytes, std::uint64_t{1} << 20);
  for (int round = 0; round < 2; ++round)
    for (std::size_t s = 0; s < 5; ++s) {
      const auto voxels = submaps.voxels(s);
      ASSERT_EQ(voxels->bricks(), originals[s].bricks());
      for (const Brick& brick : voxels->bricks())
        ASSERT_TRUE(std::equal(voxels->find(brick), voxels->find(brick) + 512, originals[s].find(brick)));
    }
  EXPECT_GT(submaps.counts().read_back, 3u);
}

TEST(BackEnd, KeepsInMemoryWhatCannotBeWritten) {
  Submaps submaps("/proc/nowhere", 1 << 20);
  BrickTree tree;
  tree.put({1, 2, 3}, BrickVoxels{5});
  submaps.add(std::move(tree));
  submaps.wait();
  EXPECT_NE(submaps.problem().find("cannot write"), std::string::npos);
  EXPECT_EQ(submaps.voxels(0)->size(), 1u);
}

}  // namespace
}  // namespace cairn
