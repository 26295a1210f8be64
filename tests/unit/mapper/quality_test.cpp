// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stages after the last frame, judged by held-out frames.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>
#include <vector>

#include "cairn/io/source.hpp"
#include "cairn/mapping/mapper.hpp"
#include "mapper/held_out_frames.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr int kFrames = 40, kHeldOut = 5;
const Camera kSmall = small_camera();

/// The room, every eighth frame held out. `depth_factor`: multiplies all depth.
std::unique_ptr<Source> room(float depth_factor = 1) {
  static const std::vector<Frame> rendered = [] {
    std::vector<Frame> frames;
    for (int i = 0; i < kFrames; ++i) frames.push_back(scene_frame(synthetic_scene("room"), kSmall, i, true));
    return frames;
  }();
  std::vector<Frame> frames = rendered;
  for (Frame& frame : frames)
    for (float& z : frame.depth) z *= depth_factor;
  return hold_out(std::make_unique<GivenFrames>(kSmall, frames), {.every = kFrames / kHeldOut});
}

Mapper mapped() {
  Options options{.fuse = {.voxel_size = 0.02f, .truncation = 0.08f}};

  Mapper mapper(kSmall, options);
  const auto source = room();
  while (const auto frame = source->next())
    EXPECT_EQ(mapper.add(*frame).state, frame->held_out ? FrameState::held_out : FrameState::fused) << frame->index;
  return mapper;
}

double largest_error(const Mapper& mapper) {
  const Scene scene = synthetic_scene("room");
  const Trajectory poses = mapper.trajectory();
  const Eigen::Isometry3d aligned =
      scene.world_from_camera(poses.front().timestamp) * poses.front().world_from_camera.inverse();
  double largest = 0;
  for (const StampedPose& pose : poses)
    largest = std::max(largest, ((aligned * pose.world_from_camera).translation() -
                                 scene.world_from_camera(pose.timestamp).translation())
                                    .norm());
  return largest;
}

TEST(Quality, KeepsStagesThatHeldOutFramesConfirmAndFusesTheseFrames) {
  Mapper mapper = mapped();
  const auto again = room();
  FinishOptions options = finish_options(Quality::good, again.get());
  options.fuses_held_out = true;
  const FinishReport report = mapper.finish(options);
  ASSERT_TRUE(report.error_before && report.error);
  EXPECT_EQ(report.error->frames, kHeldOut);
  EXPECT_LT(report.error->depth_rmse, 0.02);
  EXPECT_LE(report.error->depth_rmse, 1.03 * report.error_before->depth_rmse);
  EXPECT_TRUE(report.is_kept && report.is_reintegrated && report.has_fused_held_out);
  EXPECT_EQ(mapper.rig().depth, kSmall);
  EXPECT_EQ(mapper.trajectory().size(), static_cast<std::size_t>(kFrames));
  EXPECT_LT(largest_error(mapper), 0.01);
}

TEST(Quality, KeepsTheTrackedMapIfHeldOutFramesContradictTheNewMap) {
  Mapper mapper = mapped(), tracked = mapped();
  tracked.freeze_gravity();
  const auto wrong = room(1.04f);
  FinishOptions options = finish_options(Quality::best, wrong.get());
  const FinishReport report = mapper.finish(options);
  ASSERT_TRUE(report.error_before && report.error);
  EXPECT_GT(report.error->depth_rmse, 1.1 * report.error_before->depth_rmse);
  EXPECT_FALSE(report.is_kept || report.is_reintegrated);
  const Mesh mesh = mapper.map().mesh(), expected = tracked.map().mesh();
  EXPECT_FALSE(mesh.triangles.empty());
  EXPECT_TRUE(mesh.positions == expected.positions && mesh.triangles == expected.triangles);
  ASSERT_EQ(mapper.trajectory().size(), tracked.trajectory().size());
  for (std::size_t i = 0; i < mapper.trajectory().size(); ++i)
    EXPECT_EQ(mapper.trajectory()[i].world_from_camera.matrix(), tracked.trajectory()[i].world_from_camera.matrix());
  EXPECT_EQ(mapper.rig().depth_correction, tracked.rig().depth_correction);
}

TEST(Quality, FusesHeldOutFramesIntoTheTrackedMapToo) {
  Mapper mapper = mapped();
  const auto wrong = room(1.04f);
  FinishOptions options = finish_options(Quality::good, wrong.get());
  options.fuses_held_out = true;
  const auto bricks = mapper.statistics().bricks;
  const FinishReport report = mapper.finish(options);
  EXPECT_FALSE(report.is_kept);
  EXPECT_TRUE(report.has_fused_held_out);
  EXPECT_GE(mapper.statistics().bricks, bricks);
}

constexpr double kReadout = 0.028;

/// The room from a swinging camera with a rolling shutter, every twelfth frame held out. The rig has no readout.
/// `depth_factor`: multiplies all depth.
std::unique_ptr<Source> rolling_room(float depth_factor = 1) {
  static const std::vector<Frame> rendered = [] {
    constexpr int kCount = 90;
    const Scene scene = synthetic_scene("room");
    Camera camera = synthetic_camera();
    camera.readout = kReadout;
    SceneRenderer renderer(test_device(), scene, camera);
    std::vector<Frame> frames;
    for (int i = 0; i < kCount; ++i) {
      auto images = renderer.render(swung_in(scene), i / 30.0);
      add_noise(images, camera, "kinect", 1, i);
      frames.push_back(
          {.index = i, .timestamp = i / 30.0, .depth = std::move(images.depth), .color = std::move(images.color)});
    }
    return frames;
  }();
  std::vector<Frame> frames = rendered;
  for (Frame& frame : frames)
    for (float& z : frame.depth) z *= depth_factor;
  return hold_out(std::make_unique<GivenFrames>(synthetic_camera(), frames), {.every = 12});
}

Mapper mapped_rolling_room() {
  Mapper mapper(synthetic_camera(), {.fuse = {.voxel_size = 0.02f, .truncation = 0.08f}});
  const auto source = rolling_room();
  while (const auto frame = source->next()) (void)mapper.add(*frame);
  return mapper;
}

/// Root mean square error of the motion over ten frames, meters.
double relative_error(const Mapper& mapper) {
  constexpr std::size_t kSteps = 10;
  const PoseAt truth = swung_in(synthetic_scene("room"));
  const Trajectory poses = mapper.trajectory();
  double squared = 0;
  for (std::size_t i = kSteps; i < poses.size(); ++i) {
    const StampedPose &from = poses[i - kSteps], &to = poses[i];
    const Eigen::Isometry3d motion = from.world_from_camera.inverse() * to.world_from_camera;
    squared += (motion.inverse() * truth(from.timestamp).inverse() * truth(to.timestamp)).translation().squaredNorm();
  }
  return std::sqrt(squared / static_cast<double>(poses.size() - kSteps));
}

TEST(Quality, UsesAReadoutThatHeldOutSurfelsConfirm) {
  Mapper mapper = mapped_rolling_room(), uncorrected = mapped_rolling_room();
  const auto again = rolling_room(), same = rolling_room();
  const FinishReport report = mapper.finish(finish_options(Quality::good, again.get()));
  ASSERT_TRUE(report.error_before && report.error && report.adjusted);
  EXPECT_TRUE(report.is_kept && report.is_reintegrated);
  EXPECT_NEAR(mapper.rig().depth.readout, kReadout, 0.003);
  EXPECT_TRUE(mapper.warnings().empty());
  const AdjustReport adjusted = uncorrected.adjust();
  uncorrected.reintegrate(*same, adjusted.correction);
  EXPECT_EQ(uncorrected.rig().depth.readout, 0);
  std::printf("readout %.2f ms; error %.2f mm, %.2f without; depth %.2f -> %.2f mm\n",
              1000 * mapper.rig().depth.readout, 1000 * relative_error(mapper), 1000 * relative_error(uncorrected),
              1000 * report.error_before->depth_rmse, 1000 * report.error->depth_rmse);
  EXPECT_LT(relative_error(mapper), 0.7 * relative_error(uncorrected));
  EXPECT_LT(report.error->depth_rmse, report.error_before->depth_rmse);
}

TEST(Quality, RestoresTheShutterOfTheTrackedMap) {
  Mapper mapper = mapped_rolling_room(), tracked = mapped_rolling_room();
  tracked.freeze_gravity();
  const auto wrong = rolling_room(1.04f);
  const FinishReport report = mapper.finish(finish_options(Quality::good, wrong.get()));
  EXPECT_FALSE(report.is_kept);
  EXPECT_EQ(mapper.rig(), tracked.rig());
  const Mesh mesh = mapper.map().mesh(), expected = tracked.map().mesh();
  EXPECT_TRUE(mesh.positions == expected.positions && mesh.triangles == expected.triangles);
}

TEST(Quality, KeepsStagesWithoutHeldOutFrames) {
  Mapper mapper(kSmall, {.fuse = {.voxel_size = 0.02f, .truncation = 0.08f}});
  std::vector<Frame> frames;
  for (int i = 0; i < 10; ++i) frames.push_back(scene_frame(synthetic_scene("room"), kSmall, 2 * i));
  for (const Frame& frame : frames) (void)mapper.add(frame);
  GivenFrames again(kSmall, frames);
  const FinishReport report = mapper.finish(finish_options(Quality::good, &again));
  EXPECT_FALSE(report.error_before || report.error);
  EXPECT_TRUE(report.is_kept && report.is_reintegrated);
}

TEST(Quality, OfFastRunsNoStage) {
  const FinishOptions options = finish_options(Quality::fast, nullptr);
  EXPECT_FALSE(options.refine || options.adjust || options.reintegrate != nullptr || options.is_judged);
}

TEST(Quality, IsConfirmedByDepthAndBrightnessTogether) {
  const HeldOutError before{.frames = 8, .covered = 0.9, .depth_rmse = 0.01, .brightness_rmse = 0.1, .doubled = 0.05};
  const auto is_confirmed_with = [&](double covered, double depth, double brightness, double doubled) {
    return is_confirmed(
        before,
        {.frames = 8, .covered = covered, .depth_rmse = depth, .brightness_rmse = brightness, .doubled = doubled});
  };
  EXPECT_TRUE(is_confirmed_with(0.9, 0.01, 0.1, 0.05));
  EXPECT_TRUE(is_confirmed_with(0.9, 0.0102, 0.09, 0.05));    // slightly worse depth, better brightness
  EXPECT_FALSE(is_confirmed_with(0.9, 0.0103, 0.103, 0.05));  // slightly worse
  EXPECT_FALSE(is_confirmed_with(0.9, 0.012, 0.05, 0.05));    // clearly worse depth
  EXPECT_FALSE(is_confirmed_with(0.9, 0.009, 0.11, 0.05));    // clearly worse brightness
  EXPECT_FALSE(is_confirmed_with(0.85, 0.009, 0.09, 0.05));   // less surface
  EXPECT_FALSE(is_confirmed_with(0.9, 0.009, 0.09, 0.07));    // more of the surface is doubled
}

}  // namespace
}  // namespace cairn
