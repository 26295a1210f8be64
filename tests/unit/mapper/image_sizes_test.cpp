// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Images of any size are tracked and fused to their last pixel.
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "cairn/mapping/mapper.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr int kFrames = 8;
constexpr double kDrift = 0.003;  // meters and radians after 8 frames: a third of a voxel
constexpr float kOnSurface = 2;   // voxels to the nearest vertex: a voxel's diagonal is 1.7

Camera camera_of(int width, int height) {
  const double f = 525.0 / 640 * width;
  return {width, height, f, f, (width - 1) / 2.0, (height - 1) / 2.0, {}};
}

/// Distance from a point to the nearest vertex.
float distance(const Mesh& mesh, const Eigen::Vector3f& point) {
  float min_depth = 1e9f;
  for (const Eigen::Vector3f& p : mesh.positions) min_depth = std::min(min_depth, (p - point).norm());
  return min_depth;
}

struct Size {
  int width, height;
};

class ImageSizes : public testing::TestWithParam<Size> {};

TEST_P(ImageSizes, AreTrackedAndFusedToTheLastPixel) {
  const auto [width, height] = GetParam();
  const Camera camera = camera_of(width, height);
  const Scene scene = synthetic_scene("room");
  Mapper mapper(camera, {.up = Up::camera});  // the truth's frame
  Frame first;
  for (int i = 0; i < kFrames; ++i) {
    Frame frame = scene_frame(scene, camera, 2 * i);
    const FrameReport report = mapper.add(frame);
    ASSERT_EQ(report.state, FrameState::fused) << i << ": " << report.reason;
    if (i == 0) first = std::move(frame);
  }
  const Eigen::Isometry3d truth =
      first.world_from_camera->inverse() * scene.world_from_camera((kFrames - 1) * 2 / 30.0);
  const Eigen::Isometry3d error = truth.inverse() * mapper.trajectory().back().world_from_camera;
  EXPECT_LT(error.translation().norm(), kDrift);
  EXPECT_LT(Eigen::AngleAxisd(error.linear()).angle(), kDrift);

  const Mesh mesh = mapper.map().mesh();
  // Slightly inside of the image: at the border later frames carve.
  for (const auto& [x, y] : {std::pair{width / 50, height - 1 - height / 50},
                             {width - 1 - width / 50, height - 1 - height / 50},
                             {width - 1 - width / 50, height / 2}}) {
    const float z = first.depth[static_cast<std::size_t>(y * width + x)];
    if (z < 0.3f || z > 4.5f) continue;
    EXPECT_LT(distance(mesh, (static_cast<double>(z) * camera.ray(x, y)).cast<float>()), kOnSurface * 0.01f)
        << x << ' ' << y;
  }
}

INSTANTIATE_TEST_SUITE_P(, ImageSizes,
                         testing::Values(Size{640, 480}, Size{641, 481}, Size{642, 480}, Size{424, 240}, Size{848, 480},
                                         Size{512, 424}, Size{256, 192}, Size{320, 288}, Size{1280, 720}),
                         [](const auto& test) {
                           return std::to_string(test.param.width) + "x" + std::to_string(test.param.height);
                         });

TEST(ImageSizesAtTheirLimits, TheSmallestIsFused) {
  const Camera camera = camera_of(16, 16);
  const Scene scene = synthetic_scene("room");
  Mapper mapper(camera);
  EXPECT_EQ(mapper.add(scene_frame(scene, camera, 0)).state, FrameState::fused);
  for (int i = 1; i < 4; ++i) EXPECT_NO_THROW((void)mapper.add(scene_frame(scene, camera, i)));
}

TEST(ImageSizesAtTheirLimits, TheLargestIsFused) {
  const Camera camera = camera_of(4096, 4096);
  const Scene scene = synthetic_scene("room");
  const Frame frame = scene_frame(scene, camera, 0);
  Mapper mapper(camera, {.fuse = {.voxel_size = 0.04f, .truncation = 0.16f}}, Poses::given);
  EXPECT_EQ(mapper.add(frame).state, FrameState::fused);
  const float z = frame.depth.back();
  const Eigen::Vector3d corner = *frame.world_from_camera * (static_cast<double>(z) * camera.ray(4095, 4095));
  EXPECT_LT(distance(mapper.map().mesh(), corner.cast<float>()), kOnSurface * 0.04f);
}

}  // namespace
}  // namespace cairn
