// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/integrate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "cairn/mapping/mapper.hpp"
#include "preprocess/preprocess.hpp"
#include "shaders/voxel.h"
#include "support/scenes.hpp"
#include "volume/polygonize.hpp"

namespace cairn {
namespace {

constexpr float kVoxel = 0.01f, kTruncation = 0.04f;  // meters

/// Wall at 1 m in one color.
Frame wall(const Camera& camera, std::uint32_t gray) {
  const auto pixels = static_cast<std::size_t>(camera.width * camera.height);
  return {.depth = std::vector<float>(pixels, 1.0f),
          .color = std::vector<std::uint32_t>(pixels, 0xff000000u | gray * 0x010101u)};
}

TEST(Integrate, KeepsAdaptingColorsToSmallChanges) {
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
        if (const auto color = static_cast<std::uint32_t>(voxels[v] >> 32); color >> 24 > 30)
          sum += color & 0xff, ++count;
    }
    return sum / count;
  };
  EXPECT_NEAR(mean(), 100, 0.01);
  // Ten levels brighter: means rounded to integer levels would never change.
  for (int i = 0; i < 200; ++i)
    (void)integrator.integrate(preprocessor.preprocess(wall(camera, 110)), pose, volume, ++fused_count);
  EXPECT_NEAR(mean(), 110, 1);
}

/// A camera before a wall, and the volume of its frames.
class WallFusion {
 public:
  /// Fuses a frame of the wall at `depth` meters from a camera `closer` meters nearer to the wall than the first.
  IntegrationResult fuse(float depth, double closer = 0) {
    Frame frame = wall(camera_, 100);
    std::fill(frame.depth.begin(), frame.depth.end(), depth);
    return integrator_.integrate(preprocessor_.preprocess(frame), Eigen::Isometry3d(Eigen::Translation3d(0, 0, closer)),
                                 volume_, ++frames_);
  }
  /// Largest weight of a voxel, observations.
  float max_weight() {
    float weight = 0;
    for (const Brick& brick : volume_.bricks()) {
      const std::uint64_t* voxels = volume_.on_host().find(brick);
      for (int v = 0; v < 512; ++v) weight = std::max(weight, shader::voxel_weight(voxels[v]));
    }
    return weight;
  }

 private:
  Camera camera_{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  Preprocessor preprocessor_{test_device(), camera_, {}, 1, 0};
  Integrator integrator_{test_device(), camera_, {}};
  Volume volume_{test_device(), {.voxel_size = 0.02f, .truncation = 0.08f, .device_memory = 64 << 20}, 5.0f};
  std::uint32_t frames_ = 0;
};

constexpr float kNoise = 0.001f;  // meters, between frames of the same wall: every integrated frame changes distances

TEST(Integrate, ChangesASettledBrickEveryFourthFrameWithTheWeightOfAll) {
  WallFusion fusion;
  std::size_t all = 0;
  for (int i = 0; i < 20; ++i) all = std::max(all, fusion.fuse(1 + kNoise * static_cast<float>(i % 2)).changed.size());
  ASSERT_GT(all, 50u);
  std::vector<Brick> changed;
  for (int i = 0; i < 16; ++i) {
    const IntegrationResult fused = fusion.fuse(1 + kNoise * static_cast<float>(i % 3));
    EXPECT_LT(fused.changed.size(), all / 2);
    EXPECT_GT(fused.changed.size(), all / 8);
    if (i < 4) changed.insert(changed.end(), fused.changed.begin(), fused.changed.end());
  }
  const std::size_t all_turns = changed.size();
  std::sort(changed.begin(), changed.end(), before);
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  EXPECT_GT(changed.size(), all * 4 / 5);
  EXPECT_LT(all_turns, 2 * changed.size());  // at the border, bricks without a sample in view are not settled
  EXPECT_NEAR(fusion.max_weight(), 36, 4);
}

TEST(Integrate, ChangesASettledBrickAtOnceWhereTheSurfaceHasMoved) {
  WallFusion fusion;
  std::size_t all = 0;
  for (int i = 0; i < 40; ++i) all = std::max(all, fusion.fuse(1 + kNoise * static_cast<float>(i % 2)).changed.size());
  EXPECT_GT(fusion.fuse(0.96f).changed.size(), all * 4 / 5);
}

// A view from half the distance weighs four times as much.
TEST(Integrate, ChangesASettledBrickInEveryCloserView) {
  WallFusion fusion;
  for (int i = 0; i < 40; ++i) (void)fusion.fuse(2 + kNoise * static_cast<float>(i % 2));
  for (int i = 0; i < 6; ++i) {
    const IntegrationResult fused = fusion.fuse(1 + kNoise * static_cast<float>(i % 2), 1);
    EXPECT_GT(fused.changed.size(), static_cast<std::size_t>(fused.touched) / 2);
  }
}

TEST(Integrate, IgnoresAFrameWithoutUsableDepth) {
  const Camera camera{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Integrator integrator(test_device(), camera, {});
  Volume volume(test_device(), {.voxel_size = 0.02f, .truncation = 0.08f, .device_memory = 64 << 20}, 5.0f);
  Frame far = wall(camera, 100);
  std::fill(far.depth.begin(), far.depth.end(), 9.0f);
  const IntegrationResult fused =
      integrator.integrate(preprocessor.preprocess(far), Eigen::Isometry3d::Identity(), volume, 1);
  EXPECT_EQ(fused.touched, 0);
  EXPECT_TRUE(volume.bricks().empty());
}

/// Positions of the two sides of a sheet across z = 0 along its axis, meters: the side facing -z and the side facing z.
struct Sides {
  std::vector<float> near, far;
};

/// Fuses a sheet seen by cameras at 1 m from its two sides alternately, `turns` times.
Sides sides_of_sheet(float thickness, int turns, int frames_a_turn) {
  const Camera camera = small_camera();
  const Scene scene{.name = "sheet", .solids = {{.half_size = {0.3f, 0.3f, thickness / 2}}}};
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Integrator integrator(test_device(), camera, {});
  Volume volume(test_device(), {.voxel_size = kVoxel, .truncation = kTruncation, .device_memory = 64 << 20}, 5.0f);
  std::uint32_t fused_count = 0;
  for (int turn = 0; turn < turns; ++turn) {
    Eigen::Isometry3d pose(Eigen::AngleAxisd(turn * std::numbers::pi, Eigen::Vector3d::UnitY()));
    pose.translation() = pose.linear() * Eigen::Vector3d(0.003, 0.004, -1);  // offset between voxels and rays
    const Frame frame = scene_frame_at(scene, camera, pose);
    for (int i = 0; i < frames_a_turn; ++i)
      (void)integrator.integrate(preprocessor.preprocess(frame), pose, volume, ++fused_count);
  }
  const Mesh mesh = Polygonizer(test_device()).polygonize(volume);
  Sides sides;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    if (mesh.positions[v].head<2>().cwiseAbs().maxCoeff() > 0.15f) continue;  // each rim is seen by only one camera
    (mesh.normals[v].z() < 0 ? sides.near : sides.far).push_back(mesh.positions[v].z());
  }
  return sides;
}

TEST(Integrate, KeepsBothSidesOfAThickSheet) {
  constexpr float kThickness = kTruncation + kVoxel;
  const Sides sides = sides_of_sheet(kThickness, 2, 5);
  ASSERT_GT(sides.near.size(), 500u);
  ASSERT_GT(sides.far.size(), 500u);
  constexpr float kRounding = 1e-3f;  // meters: depth at the nearest pixel, distances of 16 bits
  for (const float z : sides.near) EXPECT_NEAR(z, -kThickness / 2, kRounding);
  for (const float z : sides.far) EXPECT_NEAR(z, kThickness / 2, kRounding);
}

// Space in front of one side is behind the other, up to the truncation: a plain mean would be 26 mm too far out. Here
// the error is 11 mm, and 14 mm when the camera returns to a side.
TEST(Integrate, KeepsBothSidesOfAThinSheetSlightlyTooThick) {
  constexpr float kThickness = 0.01f, kExcess = 0.0145f;
  for (const auto& [turns, frames_a_turn] : {std::pair{2, 5}, std::pair{2, 20}, std::pair{10, 1}, std::pair{6, 5}}) {
    const Sides sides = sides_of_sheet(kThickness, turns, frames_a_turn);
    ASSERT_GT(sides.near.size(), 500u);
    ASSERT_GT(sides.far.size(), 500u);
    for (const float z : sides.near) EXPECT_GE(z, -kThickness / 2 - kExcess);
    for (const float z : sides.far) EXPECT_LE(z, kThickness / 2 + kExcess);
    EXPECT_LT(*std::ranges::max_element(sides.near), 0);
    EXPECT_GT(*std::ranges::min_element(sides.far), 0);
  }
}

TEST(FirstFrame, WithoutUsableDepthIsSkipped) {
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
