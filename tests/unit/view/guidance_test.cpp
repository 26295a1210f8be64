// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/guidance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace cairn {
namespace {

constexpr double kStep = 1.0 / 30;  // seconds
const Rig kRig = Camera{.width = 640, .height = 480};

Frame flat(float depth, std::uint32_t color = 0xff808080u) {
  return {.depth = std::vector<float>(640 * 480, depth), .color = std::vector<std::uint32_t>(640 * 480, color)};
}

/// Simulated hand-held sensor: each step is a frame.
class Scan {
 public:
  Guidance guidance{kRig.depth};
  FrameReport report{.state = FrameState::fused,
                     .fit = {.inlier_share = 0.95, .iterations = 5},
                     .touched_bricks = 1000,
                     .new_bricks = 50};
  ImageContent content = content_of(flat(2), kRig, {});
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), move = Eigen::Vector3d::Zero();  // rad/s, m/s, in the camera's frame

  void frames(int count) {
    for (int i = 0; i < count; ++i) {
      time_ += kStep;
      if (turn.norm() > 0) pose_.rotate(Eigen::AngleAxisd(kStep * turn.norm(), turn.normalized()));
      pose_.translate(kStep * move);
      report.timestamp = time_;
      guidance.add_frame(report, content, report.state == FrameState::fused ? std::optional(pose_) : std::nullopt,
                         time_);
      const Hint hint = guidance.advice().hint;
      if (shown.empty() || shown.back() != hint) shown.push_back(hint);
    }
  }
  [[nodiscard]] Advice advice() const { return guidance.advice(); }
  std::vector<Hint> shown;  // in order of appearance

 private:
  double time_ = 100;
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
};

TEST(Guidance, ReportsGoodTrackingAtTypicalHandSpeed) {
  Scan scan;
  scan.turn = {0.2, 0.8, 0.1};  // redkitchen's median is 0.7 rad/s, 0.24 m/s
  scan.move = {0.4, 0, 0.2};
  scan.frames(120);
  EXPECT_EQ(scan.advice().words, "Tracking well");
  EXPECT_EQ(scan.shown, std::vector{Hint::good});
}

TEST(Guidance, NamesTheComputerForDroppedFrames) {
  const auto words_at = [](int dropped) {
    Guidance guidance(kRig.depth);
    FrameReport report{.state = FrameState::fused, .fit = {.inlier_share = 0.95, .iterations = 5}};
    const ImageContent content = content_of(flat(2), kRig, {});
    for (int i = 0; i < 20; ++i) {
      report.timestamp = 0.5 * i;
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.rotate(Eigen::AngleAxisd(0.25 * i, Eigen::Vector3d::UnitY()));  // 0.5 rad/s: a slow rotation
      guidance.add_frame(report, content, pose, 0.5 * i);
      guidance.add_dropped(dropped);
    }
    return guidance.advice().words;
  };
  EXPECT_EQ(words_at(14), "Computer too slow: larger voxels help");
  EXPECT_EQ(words_at(0), "Too fast: move slowly");  // of a camera with two frames per second
}

TEST(Guidance, WarnsOfFastMotion) {
  for (const auto& [turn, move] : {std::pair(1.6, 0.0), std::pair(0.0, 1.1)}) {
    Scan scan;
    scan.frames(10);
    scan.turn = {0, turn, 0};
    scan.move = {move, 0, 0};
    scan.frames(30);
    EXPECT_EQ(scan.advice().hint, Hint::slow) << turn;
    EXPECT_EQ(scan.advice().words, "Too fast: move slowly");
    scan.turn.setZero();
    scan.move.setZero();
    scan.frames(60);
    EXPECT_EQ(scan.advice().hint, Hint::good) << turn;
  }
  // At a few frames per second even a slow rotation is too large between two frames.
  Guidance guidance(kRig.depth);
  FrameReport report{.state = FrameState::fused, .fit = {.inlier_share = 0.95, .iterations = 5}};
  const ImageContent content = content_of(flat(2), kRig, {});
  for (int i = 0; i < 8; ++i) {
    report.timestamp = 0.5 * i;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.rotate(Eigen::AngleAxisd(0.25 * i, Eigen::Vector3d::UnitY()));
    guidance.add_frame(report, content, pose, 0.5 * i);
  }
  EXPECT_EQ(guidance.advice().hint, Hint::slow);
}

TEST(Guidance, FindsNearSurfaceFromDepthAndHoles) {
  Frame frame = flat(0.2f);
  EXPECT_EQ(content_of(frame, kRig, {}).near, 1);
  EXPECT_NEAR(content_of(frame, kRig, {}).median, 0.2, 1e-6);
  // Sensors measure no depth at too short a distance: half the image is at 0.4 m and the rest is a hole beside it.
  for (std::size_t i = 0; i < frame.depth.size(); ++i) frame.depth[i] = i % 640 < 320 ? 0.4f : 0.0f;
  EXPECT_NEAR(content_of(frame, kRig, {}).near, 0.5, 0.01);
  for (std::size_t i = 0; i < frame.depth.size(); ++i) frame.depth[i] = i % 640 < 320 ? 0.0f : 0.4f;
  EXPECT_NEAR(content_of(frame, kRig, {}).near, 0.5, 0.01);
  // Holes beside a surface at a good distance have another cause.
  for (std::size_t i = 0; i < frame.depth.size(); ++i) frame.depth[i] = i % 640 < 320 ? 2.0f : 0.0f;
  EXPECT_EQ(content_of(frame, kRig, {}).near, 0);
  EXPECT_EQ(content_of(frame, kRig, {}).far, 0);
  EXPECT_NEAR(content_of(frame, kRig, {}).empty, 0.5, 0.01);
}

TEST(Guidance, FindsFarSurface) {
  Frame frame = flat(7);
  EXPECT_EQ(content_of(frame, kRig, {}).far, 1);
  for (std::size_t i = 0; i < frame.depth.size(); ++i) frame.depth[i] = i % 640 < 320 ? 4.5f : 0.0f;
  EXPECT_NEAR(content_of(frame, kRig, {}).far, 0.5, 0.01);
}

TEST(Guidance, MeasuresBrightness) {
  EXPECT_NEAR(content_of(flat(2, 0xff808080u), kRig, {}).brightness.value(), 128 / 255.0, 1e-6);
  EXPECT_FALSE(content_of({.depth = std::vector<float>(640 * 480, 2.0f), .color = {}}, kRig, {}).brightness);
}

TEST(Guidance, AdvisesToStepBackOrCloser) {
  Scan scan;
  scan.frames(10);
  scan.content = content_of(flat(0.25f), kRig, {});
  scan.frames(30);
  EXPECT_EQ(scan.advice().words, "Too close: step back");
  // At an even shorter distance there is no depth at all.
  scan.content = content_of(flat(0), kRig, {});
  scan.frames(60);
  EXPECT_EQ(scan.advice().hint, Hint::close);
  scan.content = content_of(flat(2), kRig, {});
  scan.frames(60);
  EXPECT_EQ(scan.advice().hint, Hint::good);
  scan.content = content_of(flat(6), kRig, {});
  scan.frames(30);
  EXPECT_EQ(scan.advice().words, "Too far: step closer");
  scan.content = content_of(flat(0), kRig, {});
  scan.frames(60);
  EXPECT_EQ(scan.advice().hint, Hint::far);
}

TEST(Guidance, AdvisesTheTurnDirectionWhenLost) {
  // The axis and sense of the rotation, and the direction back to the earlier view.
  const std::vector<std::tuple<Eigen::Vector3d, Eigen::Vector3d, const char*, Eigen::Vector2d>> cases{
      {{0, 0.8, 0}, {0, 0, 0}, "left", {-1, 0}},  // y is down: rotated to the right
      {{0, -0.8, 0}, {0, 0, 0}, "right", {1, 0}},
      {{0.8, 0, 0}, {0, 0, 0}, "down", {0, 1}},
      {{0, 0, 0}, {0, 0.5, 0}, "up", {0, -1}}};  // moved down
  for (const auto& [turn, move, words, direction] : cases) {
    Scan scan;
    scan.turn = turn;
    scan.move = move;
    scan.frames(30);
    scan.report.state = FrameState::lost;
    scan.frames(1);
    const Advice advice = scan.advice();
    EXPECT_EQ(advice.hint, Hint::back);
    EXPECT_EQ(advice.words, std::string("Lost: turn back ") + words);
    ASSERT_TRUE(advice.turn);
    EXPECT_GT(advice.turn->dot(direction), 0.95) << words;
    scan.frames(60);  // independent of the current motion
    EXPECT_EQ(scan.advice().words, advice.words);
    scan.report.state = FrameState::fused;
    scan.turn.setZero();
    scan.move.setZero();
    scan.frames(1);
    EXPECT_EQ(scan.advice().words, "Found again");
    scan.frames(60);
    EXPECT_EQ(scan.advice().words, "Tracking well");
  }
  Scan still;  // unknown direction
  still.frames(30);
  still.report.state = FrameState::lost;
  still.frames(5);
  EXPECT_EQ(still.advice().words, "Lost: turn back");
  EXPECT_FALSE(still.advice().turn);
}

TEST(Guidance, AdvisesToMoveOnFromCoveredSurface) {
  Scan scan;
  scan.report.new_bricks = 0;
  scan.guidance.set_coverage(0.3);
  scan.frames(150);
  EXPECT_EQ(scan.advice().hint, Hint::good);
  scan.guidance.set_coverage(0.9);
  scan.frames(150);
  EXPECT_EQ(scan.advice().words, "Seen well here: move on");
  scan.report.new_bricks = 100;
  scan.frames(60);
  EXPECT_EQ(scan.advice().hint, Hint::good);
}

TEST(Guidance, WarnsOfADarkRoomABareWallAndAPoorFit) {
  Scan scan;
  scan.frames(10);
  scan.content = content_of(flat(2, 0xff0a0a0au), kRig, {});
  scan.frames(60);
  EXPECT_EQ(scan.advice().words, "Dark: more light helps");
  scan.report.fit.unobserved = 2;
  scan.frames(60);
  EXPECT_EQ(scan.advice().words, "Bare wall: move sideways");
  scan.report.fit.inlier_share = 0.3;
  scan.frames(60);
  EXPECT_EQ(scan.advice().words, "Tracking is weak: move slowly");
}

TEST(Guidance, DoesNotFlickerAroundAThreshold) {
  Scan scan;
  scan.frames(10);
  for (int i = 0; i < 200; ++i) {  // alternates around the threshold, five times per second
    scan.content.near = i / 3 % 2 == 0 ? 0.25 : 0.38;
    scan.frames(1);
  }
  EXPECT_EQ(scan.shown, (std::vector{Hint::good, Hint::close}));
  // A more urgent hint is shown at once, a less urgent one after the reading time.
  scan.report.state = FrameState::lost;
  scan.frames(1);
  EXPECT_EQ(scan.advice().hint, Hint::back);
}

TEST(Guidance, BeginsWithTheMap) {
  Scan scan;
  scan.report.fit = {};
  scan.frames(1);
  EXPECT_EQ(scan.advice().words, "Hold still: the map begins");
}

}  // namespace
}  // namespace cairn
