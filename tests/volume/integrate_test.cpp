// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/integrate.hpp"

#include <gtest/gtest.h>

#include "cairn/mapper.hpp"
#include "support/scenes.hpp"
#include "surface/preprocess.hpp"

namespace cairn {
namespace {

/// A wall at 1 m of one colour.
Frame wall(const Camera& camera, std::uint32_t grey) {
  const auto pixels = static_cast<std::size_t>(camera.width * camera.height);
  return {.depth = std::vector<float>(pixels, 1.0f),
          .colour = std::vector<std::uint32_t>(pixels, 0xff000000u | grey * 0x010101u)};
}

TEST(Integrate, ColoursFollowSmallChangesForEver) {
  const Camera camera{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Integrator integrator(test_device(), camera, {});
  Volume volume(test_device(), {.voxel_size = 0.02f, .truncation = 0.08f, .device_memory = 64 << 20}, 5.0f);
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::uint32_t fused_count = 0;
  for (int i = 0; i < 60; ++i)
    (void)integrator.integrate(preprocessor.preprocess(wall(camera, 100)), pose, volume, ++fused_count);
  const auto mean = [&] {
    double sum = 0, count = 0;
    for (const Brick& brick : volume.bricks()) {
      const std::uint64_t* voxels = volume.on_host().find(brick);
      for (int v = 0; v < 512; ++v)
        if (const auto colour = static_cast<std::uint32_t>(voxels[v] >> 32); colour >> 24 > 30)
          sum += colour & 0xff, ++count;
    }
    return sum / count;
  };
  EXPECT_NEAR(mean(), 100, 0.01);
  // Ten levels brighter: of means rounded to the nearest level none would ever move.
  for (int i = 0; i < 200; ++i)
    (void)integrator.integrate(preprocessor.preprocess(wall(camera, 110)), pose, volume, ++fused_count);
  EXPECT_NEAR(mean(), 110, 1);
}

TEST(Integrate, AFrameWithoutUsableDepthChangesNothing) {
  const Camera camera{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Integrator integrator(test_device(), camera, {});
  Volume volume(test_device(), {.voxel_size = 0.02f, .truncation = 0.08f, .device_memory = 64 << 20}, 5.0f);
  Frame far = wall(camera, 100);
  std::fill(far.depth.begin(), far.depth.end(), 9.0f);
  const Fused fused = integrator.integrate(preprocessor.preprocess(far), Eigen::Isometry3d::Identity(), volume, 1);
  EXPECT_EQ(fused.touched, 0);
  EXPECT_TRUE(volume.bricks().empty());
}

TEST(FirstFrame, WithoutUsableDepthIsSkippedAndTheNextOneBeginsTheMap) {
  const Camera camera{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  for (const Poses poses : {Poses::tracked, Poses::given}) {
    Mapper mapper(camera, {}, poses);
    for (const float depth : {0.0f, 9.0f}) {
      Frame frame = scene_frame(synthetic_scene("room"), camera, 0);
      frame.timestamp = depth;
      for (std::size_t i = 0; i < frame.depth.size(); ++i) frame.depth[i] = i % 7 == 0 ? 0.0f : depth;
      const FrameReport report = mapper.add(frame);
      if (poses == Poses::given) continue;
      EXPECT_EQ(report.state, FrameState::skipped);
      EXPECT_EQ(report.cause, FrameCause::too_little_depth);
    }
    Frame frame = scene_frame(synthetic_scene("room"), camera, 0);
    frame.timestamp = 20;
    EXPECT_EQ(mapper.add(frame).state, FrameState::fused);
    EXPECT_FALSE(mapper.map().mesh().triangles.empty());
  }
}

}  // namespace
}  // namespace cairn
