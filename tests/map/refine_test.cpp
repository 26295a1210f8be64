// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/refine.hpp"

#include <gtest/gtest.h>

#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

/// There and back through the room, with poses that drift by 2 hundredths of a radian and 7 cm.
struct Drift {
  static constexpr int kFrames = 40;
  Drift() {
    const Scene scene = synthetic_scene("room");
    for (int i = 0; i < kFrames; ++i) {
      Frame frame = scene_frame(scene, small_camera(), 6 * (i < kFrames / 2 ? i : kFrames - 1 - i), true);
      frame.index = i;
      frame.timestamp = 0.2 * i;
      Vector6d drift;
      drift << 0.01, 0.015, 0, 0.04, 0.02, 0.05;
      truth.push_back(*frame.world_from_camera);
      tracked.push_back({frame.timestamp, truth.back() * exponential(drift * i / kFrames)});
      frames.push_back(std::move(frame));
    }
  }
  /// Metres, root mean square, with the first pose as the frame.
  [[nodiscard]] double error(const Trajectory& trajectory) const {
    double squared = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const Eigen::Isometry3d found = trajectory[0].world_from_camera.inverse() * trajectory[i].world_from_camera;
      squared += (found.translation() - (truth[0].inverse() * truth[i]).translation()).squaredNorm();
    }
    return std::sqrt(squared / kFrames);
  }
  std::vector<Frame> frames;
  std::vector<Eigen::Isometry3d> truth;
  Trajectory tracked;
};

TEST(Refine, TakesTheDriftOutOfAWayThereAndBack) {
  const Drift d;
  const TemporaryFolder folder;
  Refine refine(test_device(), small_camera(), {});
  const Matrix6d information = 1e6 * Matrix6d::Identity();
  for (std::size_t i = 0; i < d.frames.size(); ++i)
    refine.add(d.frames[i], d.tracked[i].world_from_camera, i > 0 ? &information : nullptr);
  const Refined refined = refine(d.tracked, folder / "graph.g2o");
  std::printf("%.1f mm -> %.1f mm, %d of %d pairs aligned, %d believed\n", 1000 * d.error(d.tracked),
              1000 * d.error(refined.trajectory), refined.pairs_aligned, refined.pairs_tried, refined.pairs_believed);
  EXPECT_GT(d.error(d.tracked), 0.02);
  EXPECT_LT(d.error(refined.trajectory), 0.3 * d.error(d.tracked));
  EXPECT_LT(refined.cost, refined.cost_before);
  EXPECT_EQ(read_g2o(folder / "graph.g2o").world_from_node.size(), static_cast<std::size_t>(refined.keyframes));
}

TEST(Refine, LeavesASingleKeyframeAlone) {
  const Drift d;
  Refine refine(test_device(), small_camera(), {});
  refine.add(d.frames[0], d.tracked[0].world_from_camera, nullptr);
  const Refined refined = refine({d.tracked[0]});
  EXPECT_TRUE(refined.trajectory[0].world_from_camera.isApprox(d.tracked[0].world_from_camera));
}

}  // namespace
}  // namespace cairn
