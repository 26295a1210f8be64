// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "track/icp.hpp"

#include <gtest/gtest.h>

#include <bit>

#include "support/scenes.hpp"
#include "support/twins.hpp"
#include "volume/integrate.hpp"

namespace cairn {
namespace {

/// The room fused from one exact frame, and the tools to align with it.
struct Room {
  Camera camera = small_camera();
  Scene scene = synthetic_scene("room");
  TrackOptions options{.finest_level = 0};
  Preprocess preprocess{test_device(), camera, {}, options.levels, 0};
  Volume volume{test_device(), {.voxel_size = 0.01f, .truncation = 0.04f, .device_memory = 256 << 20}, 5.0f};
  Integrate integrate{test_device(), camera, {}};
  Raycast raycast{test_device(), camera, {}, options.levels, 0};
  Icp icp{test_device(), options};
  Frame frame = scene_frame(scene, camera, 0);
  Room() { integrate(preprocess(frame), *frame.world_from_camera, volume, 1); }
};

TEST(Icp, StaysWhereItIs) {
  Room s;
  const Surface live = s.preprocess(s.frame);
  const Eigen::Isometry3d pose = *s.frame.world_from_camera;
  const Alignment a = s.icp(live, s.raycast(s.volume, pose), pose);
  EXPECT_TRUE(a.converged()) << a.lost;
  const Eigen::Isometry3d error = pose.inverse() * a.submap_from_camera;
  EXPECT_LT(error.translation().norm(), 1e-3);  // a tenth of a voxel: the filter rounds corners, the model does not
  EXPECT_LT(Eigen::AngleAxisd(error.linear()).angle(), 1e-3);
  EXPECT_GT(a.inlier_share, 0.9);
}

TEST(Icp, FindsAKnownMotion) {
  Room s;
  // 5 cm and 4 degrees: a brisk hand between two frames.
  Eigen::Isometry3d guess = *s.frame.world_from_camera;
  guess = guess * Eigen::Translation3d(0.03, -0.02, 0.035) *
          Eigen::AngleAxisd(0.07, Eigen::Vector3d(1, 2, -1).normalized());
  const Surface live = s.preprocess(s.frame);
  const Alignment a = s.icp(live, s.raycast(s.volume, guess), guess);
  EXPECT_TRUE(a.converged()) << a.lost;
  const Eigen::Isometry3d error = s.frame.world_from_camera->inverse() * a.submap_from_camera;
  EXPECT_LT(error.translation().norm(), 2e-3);
  EXPECT_LT(Eigen::AngleAxisd(error.linear()).angle(), 2e-3);
}

TEST(Icp, KnowsThatAnotherPlaceIsNotThisOne) {
  Room s;
  const Frame elsewhere = scene_frame(s.scene, s.camera, 360);  // half way around the room
  const Surface live = s.preprocess(elsewhere);
  const Eigen::Isometry3d guess = *s.frame.world_from_camera;
  const Alignment a = s.icp(live, s.raycast(s.volume, guess), guess);
  EXPECT_FALSE(a.converged());
}

TEST(Icp, SaysWhenThereIsNoDepth) {
  Room s;
  Frame dark = s.frame;
  std::fill(dark.depth.begin(), dark.depth.end(), 0.0f);
  const Surface live = s.preprocess(dark);
  const Eigen::Isometry3d guess = *s.frame.world_from_camera;
  EXPECT_EQ(s.icp(live, s.raycast(s.volume, guess), guess).lost, "too little depth");
}

TEST(IcpReduce, EqualsItsPlainTwin) {
  Room s;
  TrackOptions one = s.options;
  one.levels = 1;
  one.iterations_finest = 1;  // the information of a result is that of its last linearisation
  Icp icp(test_device(), one);
  const Surface live = s.preprocess(s.frame);
  Eigen::Isometry3d guess = *s.frame.world_from_camera * Eigen::Translation3d(0.01, 0.005, -0.01);
  const ModelView model = s.raycast(s.volume, guess);
  const Eigen::Isometry3d start = *s.frame.world_from_camera;
  const Alignment a = icp(live, model, start);

  const auto pixels = static_cast<std::size_t>(s.camera.width * s.camera.height);
  const auto l = download<shader::uvec2>(live.levels[0]->points, pixels),
             m = download<shader::uvec2>(model.levels[0]->points, pixels);
  const Eigen::Isometry3d model_from_live = model.submap_from_camera.inverse() * start;
  Matrix6d expected = Matrix6d::Zero();
  for (int y = 0; y < s.camera.height; ++y)
    for (int x = 0; x < s.camera.width; ++x) {
      const auto& lp = l[static_cast<std::size_t>(y * s.camera.width + x)];
      const double z = std::bit_cast<float>(lp.x);
      if (z <= 0 || lp.y == 0) continue;
      const Eigen::Vector3d p = model_from_live * (s.camera.ray(x, y) * z);
      const Eigen::Vector2d pixel = s.camera.project(p).array() + 0.5;
      if (p.z() <= 0 || pixel.minCoeff() < 0 || pixel.x() >= s.camera.width || pixel.y() >= s.camera.height) continue;
      const int u = static_cast<int>(pixel.x()), v = static_cast<int>(pixel.y());
      const auto& mp = m[static_cast<std::size_t>(v * s.camera.width + u)];
      const double zm = std::bit_cast<float>(mp.x);
      if (zm <= 0 || mp.y == 0) continue;
      const Eigen::Vector3d n = twin::unpack_normal(mp.y).cast<double>(), gap = s.camera.ray(u, v) * zm - p;
      const Eigen::Vector3d ln = model_from_live.linear() * twin::unpack_normal(lp.y).cast<double>();
      if (gap.norm() >= one.max_distance || ln.dot(n) <= std::cos(one.max_angle)) continue;
      const double sigma = shader::depth_noise(static_cast<float>(z)), r = n.dot(gap) / sigma;
      Eigen::Matrix<double, 6, 1> j;
      j << p.cross(n) / sigma, n / sigma;
      expected += std::min(1.0, one.huber / std::max(std::abs(r), 1e-6)) * j * j.transpose();
    }
  EXPECT_LT((a.information - expected).norm() / expected.norm(), 1e-3);  // pixels on a border may match a neighbour
  EXPECT_GT(expected.norm(), 1e6);
}

}  // namespace
}  // namespace cairn
