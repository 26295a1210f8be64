// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What happens to tracking when the camera or its driver misbehaves: the synthetic room with Kinect noise at full size,
// default options. No pose may be fused that is wrong.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "cairn/evaluation.hpp"
#include "cairn/mapper.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr double kWrong = 0.05;  // metres; a pose farther than this from the truth is wrong

struct Outcome {
  std::vector<FrameReport> reports;
  int fused = 0, wrong = 0;
  double rmse = 0;  // metres, of the fused frames, the first one's pose being true
  std::size_t places = 0;
};

using Path = std::function<Eigen::Isometry3d(double seconds)>;
using Spoil = std::function<void(int index, Frame&)>;
using Sees = std::function<bool(int index)>;

/// Every `step`th of the frames; where the camera `sees` nothing they are black.
Outcome run(const Scene& scene, int frames, const Path& path, const Spoil& spoil = {}, const Sees& sees = {},
            int step = 1) {
  const Camera camera = synthetic_camera();
  SceneRenderer renderer(test_device(), scene, camera);
  Mapper mapper(camera);
  Outcome outcome;
  std::optional<Eigen::Isometry3d> start;
  double squared = 0;
  for (int i = 0; i < frames; i += step) {
    const double time = i / 30.0;
    const Eigen::Isometry3d truth = path(time);
    Frame frame{.index = i, .timestamp = time};
    if (!sees || sees(i)) {
      auto images = renderer.render(truth, time);
      add_kinect_noise(images, camera, 1, i);
      frame.depth = std::move(images.depth), frame.colour = std::move(images.colour);
    } else {
      const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
      frame.depth.assign(pixels, 0.0f), frame.colour.assign(pixels, 0xff000000u);
    }
    if (spoil) spoil(i, frame);
    if (!start) start = truth;
    outcome.reports.push_back(mapper.add(frame));
    if (outcome.reports.back().state != FrameState::fused) continue;
    const Eigen::Isometry3d found = *start * mapper.trajectory().back().world_from_camera;
    const double error = (found.translation() - truth.translation()).norm();
    ++outcome.fused;
    outcome.wrong += error > kWrong;
    squared += error * error;
  }
  outcome.rmse = std::sqrt(squared / std::max(outcome.fused, 1));
  ::testing::Test::RecordProperty("rmse_mm", std::to_string(1000 * outcome.rmse));
  std::printf("%d of %zu frames fused, %d wrong, RMSE %.1f mm\n", outcome.fused, outcome.reports.size(), outcome.wrong,
              1000 * outcome.rmse);
  return outcome;
}

const Scene& room() {
  static const Scene scene = synthetic_scene("room");
  return scene;
}
Eigen::Isometry3d along(double seconds) { return room().world_from_camera(seconds); }

/// Frames from `first` on until one is fused.
int frames_until_found(const Outcome& o, int first) {
  for (std::size_t i = 0; i < o.reports.size(); ++i)
    if (o.reports[i].index >= first && o.reports[i].state == FrameState::fused) return o.reports[i].index - first;
  return 1000;
}

TEST(Robustness, WhipPan) {
  // 150 degrees in half a second, 300 degrees a second.
  const auto o = run(room(), 60, [](double t) {
    const double turned = std::clamp((t - 0.5) / 0.5, 0.0, 1.0) * 150 * std::numbers::pi / 180;
    return along(std::min(t, 0.5) + std::max(0.0, t - 1.0)) * Eigen::AngleAxisd(turned, Eigen::Vector3d::UnitY());
  });
  EXPECT_EQ(o.wrong, 0);
  EXPECT_LE(frames_until_found(o, 31), 10);
  EXPECT_LE(o.rmse, 0.01);
}

TEST(Robustness, Kidnapped) {
  // There and back; in the middle third nothing is seen while the camera goes somewhere else.
  const auto o = run(
      room(), 135, [](double t) { return along(1.5 * std::min(t, 4.5 - t)); }, {},
      [](int i) { return i < 45 || i >= 90; }, 2);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_LE(frames_until_found(o, 90), 10);
  EXPECT_LE(o.rmse, 0.015);
  EXPECT_GE(o.fused, 23 + 17);
}

TEST(Robustness, LensCapForTwoSeconds) {
  const auto o = run(
      room(), 90, [](double t) { return along(t < 0.5 ? t : std::max(0.5, t - 2.0)); }, {},
      [](int i) { return i < 15 || i >= 75; });
  EXPECT_EQ(o.wrong, 0);
  EXPECT_EQ(o.fused, 30);
}

TEST(Robustness, NoDepthAndFlatDepth) {
  const auto o = run(room(), 40, along, [](int i, Frame& frame) {
    if (i % 10 == 5) std::fill(frame.depth.begin(), frame.depth.end(), 0.0f);
    if (i % 10 == 8) std::fill(frame.depth.begin(), frame.depth.end(), 1.5f);
  });
  EXPECT_EQ(o.wrong, 0);
  EXPECT_EQ(o.fused, 32);
}

TEST(Robustness, FrozenImages) {
  // The driver repeats an image for half a second, the hand goes on.
  Frame kept;
  const auto o = run(room(), 60, along, [&](int i, Frame& frame) {
    if (i == 20) kept = frame;
    if (i > 20 && i < 35) frame.depth = kept.depth, frame.colour = kept.colour;
  });
  EXPECT_EQ(o.wrong, 0);
  EXPECT_EQ(o.reports[30].state, FrameState::skipped);
  EXPECT_EQ(o.fused, 48);  // an image may come three times
  EXPECT_LE(frames_until_found(o, 35), 10);
}

TEST(Robustness, EverySecondAndThirdFrame) {
  for (const int step : {2, 3}) {
    const auto o = run(room(), 90, along, {}, {}, step);
    EXPECT_EQ(o.wrong, 0) << step;
    EXPECT_EQ(static_cast<std::size_t>(o.fused), o.reports.size()) << step;
    EXPECT_LE(o.rmse, 0.01) << step;
  }
}

TEST(Robustness, ShuffledExposure) {
  const auto o = run(
      room(), 60, along,
      [](int i, Frame& frame) {
        const std::uint32_t percent[] = {100, 60, 80, 45, 95};
        for (auto& pixel : frame.colour) {
          std::uint32_t changed = 0xff000000u;
          for (int shift = 0; shift < 24; shift += 8)
            changed |= (((pixel >> shift) & 0xff) * percent[i % 5] / 100) << shift;
          pixel = changed;
        }
      },
      {}, 2);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_EQ(o.fused, 30);
  EXPECT_LE(o.rmse, 0.01);
}

TEST(Robustness, ColourThatEndsHalfWayOrHasAnotherSize) {
  const auto o = run(
      room(), 60, along,
      [](int i, Frame& frame) {
        if (i >= 20 && i < 40) frame.colour.resize(frame.colour.size() / 4);
        if (i >= 40) frame.colour.clear();
      },
      {}, 2);
  EXPECT_EQ(o.fused, 30);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_LE(o.rmse, 0.01);
  EXPECT_NE(o.reports[13].reason.find("depth alone"), std::string::npos);
  EXPECT_EQ(o.reports[25].fit.photometric_share, 0);
}

TEST(Robustness, SomebodyWalksThroughTheRoom) {
  // In front of the camera, at 1.2 m, into a part of the room that is not mapped yet.
  const auto o = run(synthetic_scene("room-with-mover"), 90, along, {}, {}, 2);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_EQ(o.fused, 45);
  EXPECT_LE(o.rmse, 0.01);
}

TEST(Robustness, SomethingSmallMovesThroughTheRoom) {
  // Less than half a person's width.
  Scene scene = synthetic_scene("room-with-mover");
  for (auto& s : scene.solids)
    if (s.period > 0) s.half_size.x() *= 0.4f;
  const auto o = run(scene, 120, along, {}, {}, 2);
  const auto most = std::max_element(o.reports.begin(), o.reports.end(),
                                     [](const auto& a, const auto& b) { return a.moving < b.moving; });
  EXPECT_GT(most->moving, 0.02);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_LE(o.rmse, 0.01);
}

TEST(Robustness, LostForLongItBeginsAnotherPieceAndJoinsItByALoop) {
  const Scene scene = synthetic_scene("room");
  const Camera camera = synthetic_camera();
  SceneRenderer renderer(test_device(), scene, camera);
  Options options;
  options.map.lost_frames = 20;
  Mapper mapper(camera, options);
  // Two seconds of the way; then carried, in the dark, to where the map has never been, and back from there.
  std::vector<double> way;
  for (int i = 0; i < 20; ++i) way.push_back(i / 10.0);
  for (int i = 0; i < 73; ++i) way.push_back(8.0 - i / 10.0);
  Trajectory truth;
  int lost = 0, pieces_at_most = 0;
  for (std::size_t i = 0; i < way.size(); ++i) {
    truth.push_back({static_cast<double>(i) / 10.0, scene.world_from_camera(way[i])});
    auto images = renderer.render(truth.back().world_from_camera);
    add_kinect_noise(images, camera, 1, static_cast<int>(i));
    const FrameReport report = mapper.add({.index = static_cast<int>(i),
                                           .timestamp = truth.back().timestamp,
                                           .depth = std::move(images.depth),
                                           .colour = std::move(images.colour)});
    lost += report.state == FrameState::lost;
    pieces_at_most = std::max(pieces_at_most, mapper.statistics().components);
  }
  EXPECT_NEAR(lost, options.map.lost_frames - 1, 2);
  EXPECT_EQ(pieces_at_most, 2);
  EXPECT_FALSE(mapper.loops().empty());
  const Mesh mesh = mapper.map().mesh();
  EXPECT_EQ(mapper.statistics().components, 1);
  const Trajectory found = mapper.trajectory();
  EXPECT_EQ(found.size(), way.size() - static_cast<std::size_t>(lost));
  const TrajectoryError error = evaluate_trajectory(found, truth);
  std::printf("%d lost, %zu loops, ATE %.1f mm\n", lost, mapper.loops().size(), 1000 * error.ate.rmse);
  EXPECT_LT(error.ate.rmse, 0.015);
}

}  // namespace
}  // namespace cairn
