// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/refine.hpp"

#include <gtest/gtest.h>

#include "support/scenes.hpp"

namespace cairn {
namespace {

/// Path through the room and back, with a drift of the poses by 0.02 rad and 7 cm.
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
      tracked.push_back({frame.timestamp, truth.back() * retract(drift * i / kFrames)});
      frames.push_back(std::move(frame));
    }
  }
  /// Root mean square error in meters, relative to the first pose.
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

/// Back end with the drifting poses as tracking results.
struct Mapped {
  explicit Mapped(const Drift& d, std::size_t frames) {
    const Matrix6d information = 1e6 * Matrix6d::Identity();
    for (std::size_t i = 0; i < frames; ++i)
      back_end.add(d.frames[i], surface_of(d.frames[i]), d.tracked[i].world_from_camera, i > 0 ? &information : nullptr,
                   {}, volume, static_cast<std::uint32_t>(i + 1));
  }
  Options options;
  Volume volume{test_device(), options.fuse, 5.0f};
  BackEnd back_end{test_device(), small_camera(), options};
};

TEST(Refine, RemovesTheDriftOfARoundTrip) {
  const Drift d;
  Mapped m(d, d.frames.size());
  const RefineReport refined = refine(m.back_end, {});
  const Trajectory trajectory = m.back_end.atlas().trajectory(0, 0, d.frames.size());
  std::printf("%.1f mm -> %.1f mm, %d of %d pairs aligned, %d inliers\n", 1000 * d.error(d.tracked),
              1000 * d.error(trajectory), refined.pairs_aligned, refined.pairs_tried, refined.pairs_inlier);
  EXPECT_GT(d.error(d.tracked), 0.02);
  EXPECT_LT(d.error(trajectory), 0.3 * d.error(d.tracked));
  EXPECT_LT(refined.cost, refined.cost_before);
}

TEST(Refine, KeepsASingleKeyframe) {
  const Drift d;
  Mapped m(d, 1);
  (void)refine(m.back_end, {});
  EXPECT_TRUE(m.back_end.atlas().trajectory(0, 0, 1)[0].world_from_camera.isApprox(d.tracked[0].world_from_camera));
}

}  // namespace
}  // namespace cairn
