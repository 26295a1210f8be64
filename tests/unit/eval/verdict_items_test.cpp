// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "eval/verdict_items.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <sstream>

namespace cairn {
namespace {

constexpr int kFrames = 40;
const Camera kCamera{160, 120, 131.25, 131.25, 79.5, 59.5, {}};

Eigen::Isometry3d at(double x, double y, double z) { return Eigen::Isometry3d(Eigen::Translation3d(x, y, z)); }

/// Frame with depth as a function of pixel.
Frame frame_of(int index, const std::function<float(int, int)>& depth) {
  Frame frame{.index = index, .timestamp = index / 30.0};
  for (int y = 0; y < kCamera.height; ++y)
    for (int x = 0; x < kCamera.width; ++x) frame.depth.push_back(depth(x, y));
  return frame;
}

/// Wall 2 m ahead with a box in front, between `left` and `right`, that moves back and forth by 20 cm.
Frame frame_of_turntable(int index, int left, int right) {
  return frame_of(index, [=](int x, int y) {
    const bool is_box = x >= left && x < right && y >= 40 && y < 80;
    return is_box ? 1.2f + 0.2f * static_cast<float>(index % 7) / 6 : 2.0f;
  });
}

std::vector<PlacedSample> placed(const FrameSamples& samples, const std::function<Eigen::Isometry3d(double)>& pose) {
  std::vector<PlacedSample> all;
  for (const FrameSample* s : samples.all()) all.push_back({s, pose(s->timestamp)});
  return all;
}

FrameSamples samples_of(const std::function<Frame(int)>& frame) {
  FrameSamples samples{Rig(kCamera)};
  for (int i = 0; i < kFrames; ++i) samples.add(frame(i), 0, 0.3, 5);
  return samples;
}

/// Rectangle at depth z, facing the camera at the origin.
Mesh rectangle(float z, float left, float right) {
  Mesh mesh;
  mesh.positions = {{left, -5, z}, {right, -5, z}, {right, 5, z}, {left, 5, z}};
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  return mesh;
}

TEST(StillView, FindsCameraAtRestBeforeTurntable) {
  const FrameSamples samples = samples_of([](int i) { return frame_of_turntable(i, 60, 100); });
  const StillView view = compare_still(samples.camera(), {}, placed(samples, [](double) { return at(0, 0, 0); }));
  EXPECT_TRUE(view.is_turntable());
  EXPECT_NEAR(view.moved, 40.0 * 40 / (160 * 120), 0.04);
  EXPECT_GT(view.still, 0.8);
  // Also if tracking followed the object, and the background seems to rotate.
  const StillView followed = compare_still(samples.camera(), {}, placed(samples, [](double t) {
                                             Eigen::Isometry3d pose = at(1.5 * std::sin(t), 0, 1.3 - 1.3 * std::cos(t));
                                             pose.rotate(Eigen::AngleAxisd(-t, Eigen::Vector3d::UnitY()));
                                             return pose;
                                           }));
  EXPECT_GT(followed.still, view.moved);
}

TEST(StillView, PassesCameraAlongPlainWall) {
  const FrameSamples samples = samples_of([](int i) { return frame_of_turntable(i, 0, 0); });
  EXPECT_FALSE(
      compare_still(samples.camera(), {}, placed(samples, [](double t) { return at(0.3 * t, 0, 0); })).is_turntable());
  EXPECT_FALSE(compare_still(samples.camera(), {}, placed(samples, [](double) { return at(0, 0, 0); })).is_turntable());
}

TEST(StillView, PassesCameraThatRestsFirst) {
  // Moves along a stepped wall in the second half of the recording.
  const auto path = [](double t) { return std::max(0.0, t - 0.6); };
  const FrameSamples samples = samples_of([&](int i) {
    const double x = path(i / 30.0);
    return frame_of(i, [=](int u, int) {
      const double across = 2 * (u - kCamera.cx) / kCamera.fx + x;
      return 2.0f + 0.3f * static_cast<float>(static_cast<int>(std::floor(across / 0.4)) & 1);
    });
  });
  EXPECT_FALSE(
      compare_still(samples.camera(), {}, placed(samples, [&](double t) { return at(path(t), 0, 0); })).is_turntable());
}

TEST(DepthAgreement, CountsSurfaceInFrontAndMissingSurface) {
  const FrameSamples samples = samples_of([](int i) { return frame_of_turntable(i, 0, 0); });
  const auto here = placed(samples, [](double) { return at(0, 0, 0); });
  const DepthTolerance tolerance{{}, 0.01};
  const auto compare = [&](const std::vector<Mesh>& parts) {
    return compare_depth(parts, samples.camera(), {}, tolerance, here);
  };
  const DepthAgreement right = compare({rectangle(2, -5, 5)});
  EXPECT_EQ(right.frames, static_cast<int>(here.size()));
  EXPECT_EQ(right.in_front, 0);
  EXPECT_EQ(right.missing, 0);
  EXPECT_LT(right.rmse, 0.001);
  // A second sheet, 15 cm before a quarter of the view.
  const DepthAgreement twice = compare({rectangle(2, -5, 5), rectangle(1.85f, 0.55f, 5)});
  EXPECT_NEAR(twice.in_front, 0.22, 0.06);
  EXPECT_NEAR(compare({rectangle(2.3f, -5, 5)}).missing, 1, 1e-9);
  EXPECT_EQ(compare({rectangle(2.3f, -5, 5)}).in_front, 0);
}

TEST(DepthAgreement, PassesSurfaceThatEndsBesideHolesOfDepth) {
  constexpr double kVoxel = 0.05;
  // Depth of a wall left of the middle alone, as between two holes of a stereo camera.
  const FrameSamples samples =
      samples_of([](int i) { return frame_of(i, [](int u, int) { return u < kCamera.cx ? 2.0f : 0.0f; }); });
  const auto here = placed(samples, [](double) { return at(0, 0, 0); });
  const auto missing = [&](float end) {
    return compare_depth({rectangle(2, -5, end)}, samples.camera(), {}, {{}, kVoxel / 100}, here).missing;
  };
  EXPECT_GT(missing(-0.3f), 0.1);
  const DepthTolerance tolerance{{}, kVoxel};
  const DepthAgreement agreement =
      compare_depth({rectangle(2, -5, -static_cast<float>(1.5 * kVoxel))}, samples.camera(), {}, tolerance, here);
  EXPECT_GT(agreement.points, 1000);
  EXPECT_EQ(agreement.missing, 0);
}

TEST(Speeds, ReportJumpsAndIgnoreGaps) {
  const auto run = [](double jump, bool is_lost_before) {
    Speeds speeds{MotionOptions{}};
    for (int i = 0; i < 10; ++i) {
      FrameReport report{.index = i, .timestamp = i / 30.0, .state = FrameState::fused};
      const bool has_pose = i != 5 || !is_lost_before;
      if (has_pose) report.tracked_from_camera = at(0.01 * i + (i > 5 ? jump : 0), 0, 0);
      speeds.add(report, has_pose, 1 / 30.0);
    }
    return speeds;
  };
  EXPECT_NEAR(run(0, false).speed().value, 0.3, 1e-9);
  EXPECT_NEAR(run(0.11, false).speed().value, 3.6, 1e-9);
  EXPECT_NEAR(run(0.11, false).speed().timestamp, 0.2, 1e-9);
  EXPECT_NEAR(run(0.11, true).speed().value, 0.3, 1e-9);
  Measured measured;
  const auto weak_items = [&] {
    const auto items = items_of(measured);
    return std::count_if(items.begin(), items.end(),
                         [](const Verdict::Item& i) { return i.level != Verdict::Level::good; });
  };
  measured.speeds = run(0.05, false);
  EXPECT_EQ(weak_items(), 0);
  measured.speeds = run(0.11, false);
  EXPECT_EQ(weak_items(), 1);
}

TEST(PoseAgreement, DistinguishesScaleErrorsAndJumpsFromDrift) {
  const auto path = [](double scale, double jump) {
    Trajectory all;
    for (int i = 0; i < 600; ++i) {
      const double t = i / 30.0;
      all.push_back({t, at(scale * 0.5 * t + (t > 10 ? jump : 0), scale * 0.2 * std::sin(t), 0)});
    }
    return all;
  };
  const auto agrees = [&](double scale, double jump) {
    Measured measured;
    measured.device = compare_poses(path(scale, jump), path(1, 0));
    const auto items = items_of(measured);
    return std::all_of(items.begin(), items.end(),
                       [](const Verdict::Item& i) { return i.level == Verdict::Level::good; });
  };
  EXPECT_TRUE(agrees(1, 0));
  EXPECT_TRUE(agrees(1.01, 0));
  EXPECT_FALSE(agrees(0.95, 0));
  EXPECT_FALSE(agrees(1, 1.0));
  EXPECT_EQ(compare_poses(path(1, 0), {}).windows, 0);
}

TEST(FrameSamples, AreBoundedAndContinueAfterRestore) {
  FrameSamples uninterrupted{Rig(kCamera)}, first{Rig(kCamera)}, second{Rig(kCamera)};
  for (int i = 0; i < 300; ++i) {
    Frame frame = frame_of_turntable(i, 60, 100);
    frame.held_out = i % 10 == 9;
    uninterrupted.add(frame, 0, 0.3, 5);
    if (i == 150) {
      std::stringstream saved;
      saved.precision(17);
      first.save(saved);
      second.restore(saved);
    }
    (i < 150 ? first : second).add(frame, 0, 0.3, 5);
  }
  const auto text = [](const FrameSamples& samples) {
    std::ostringstream out;
    samples.save(out);
    return std::move(out).str();
  };
  EXPECT_EQ(text(second), text(uninterrupted));
  EXPECT_LE(uninterrupted.all().size(), FrameSamples::kMaxFused + FrameSamples::kMaxHeldOut);
  EXPECT_GE(uninterrupted.all().size(), FrameSamples::kMaxFused / 2);
  std::istringstream damaged("3 1 1 0.5 0 xzz x");
  second.restore(damaged);
  EXPECT_EQ(text(second), text(uninterrupted));
}

TEST(Verdict, IsWeakWithoutColorOrGravity) {
  RunMonitor evidence(kCamera, {});
  for (int i = 0; i < kFrames; ++i) {
    const Frame frame = frame_of_turntable(i, 60, 100);
    evidence.add(frame, {.index = i, .timestamp = frame.timestamp, .state = FrameState::fused});
  }
  const Verdict colorless = evidence.verdict({.total = kFrames, .fused = kFrames});
  EXPECT_EQ(colorless.level, Verdict::Level::weak);
  EXPECT_EQ(colorless.reasons,
            std::vector<std::string>{"there is no color: tracking by depth alone fails at plain walls"});
  const RunMonitor none(kCamera, {});
  const Verdict tilted =
      none.verdict({.total = kFrames, .fused = kFrames, .upright_unknown = "not known: say it with --up"});
  EXPECT_EQ(tilted.level, Verdict::Level::weak);
  EXPECT_EQ(tilted.reasons, std::vector<std::string>{"up axis not known: say it with --up"});
  EXPECT_EQ(tilted.evidence.front().name, "frames_in_map");
}

}  // namespace
}  // namespace cairn
