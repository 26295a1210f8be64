// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Tracking with a misbehaving camera or driver: the synthetic room with Kinect noise at full size, default options. No
// wrong pose may be fused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "cairn/eval/evaluation.hpp"
#include "cairn/mapping/mapper.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr double kWrong = 0.05;  // meters; a pose farther than this from the truth is wrong

struct Outcome {
  std::vector<FrameReport> reports;
  int fused = 0, wrong = 0;
  double last_error = 0;  // meters
  double rmse = 0;        // meters, of the fused frames, relative to the true pose of the first
  std::size_t places = 0;
  std::size_t warnings = 0;
};

using Path = std::function<Eigen::Isometry3d(double seconds)>;
using Spoil = std::function<void(int index, Frame&)>;
using Sees = std::function<bool(int index)>;

/// Measurements of a phone's gyroscope along a path between two times, at 200 Hz: noise and a bias of 0.5 degrees/s.
std::vector<AngularRate> gyroscope(const Path& path, double since, double until) {
  constexpr double kStep = 0.005, kNoise = 0.0017;  // seconds; rad/s, with alternating sign
  static const Eigen::Vector3d bias(0.006, -0.005, 0.004);
  std::vector<AngularRate> samples;
  for (auto n = static_cast<int>(std::floor(since / kStep)) + 1; n * kStep <= until; ++n) {
    const double t = n * kStep;
    const Eigen::AngleAxisd turn((path(t - 0.5 * kStep).inverse() * path(t + 0.5 * kStep)).linear());
    samples.push_back(
        {t, turn.angle() / kStep * turn.axis() + bias + Eigen::Vector3d::Constant(n % 2 == 0 ? kNoise : -kNoise)});
  }
  return samples;
}

/// Measurements of a phone's accelerometer, at the times of the gyroscope's: noise and a bias.
std::vector<Acceleration> accelerometer(const Path& path, const std::vector<AngularRate>& times) {
  constexpr double kStep = 0.002, kNoise = 0.02;  // seconds; m/s^2, with alternating sign
  static const Eigen::Vector3d bias(0.05, -0.04, 0.06), gravity(0, 9.81, 0);
  std::vector<Acceleration> samples;
  for (const auto& [t, rate] : times) {
    const Eigen::Vector3d force =
        (path(t - kStep).translation() - 2 * path(t).translation() + path(t + kStep).translation()) / (kStep * kStep) -
        gravity;
    const double noise = samples.size() % 2 == 0 ? kNoise : -kNoise;
    samples.push_back({t, path(t).linear().transpose() * force + bias + Eigen::Vector3d::Constant(noise)});
  }
  return samples;
}

/// Adds the samples of both inertial sensors.
Spoil with_accelerometer(const Path& path, const Spoil& spoil = {}) {
  return [path, spoil](int i, Frame& frame) {
    frame.accelerations = accelerometer(path, frame.gyro);
    if (spoil) spoil(i, frame);
  };
}

/// Runs every `step`th frame; black where `sees` is false.
Outcome run(const Scene& scene, int frames, const Path& path, const Spoil& spoil = {}, const Sees& sees = {},
            int step = 1, bool has_gyroscope = false) {
  const Camera camera = synthetic_camera();
  SceneRenderer renderer(test_device(), scene, camera);
  Rig rig = camera;
  if (has_gyroscope) rig.camera_from_imu = Eigen::Quaterniond::Identity();
  Mapper mapper(rig, {.up = Up::camera});  // errors are computed in the first camera's frame
  Outcome outcome;
  std::optional<Eigen::Isometry3d> start;
  double squared = 0;
  for (int i = 0; i < frames; i += step) {
    const double time = i / 30.0;
    const Eigen::Isometry3d truth = path(time);
    Frame frame{.index = i, .timestamp = time};
    if (!sees || sees(i)) {
      auto images = renderer.render(truth, time);
      add_noise(images, camera, "kinect", 1, i);
      frame.depth = std::move(images.depth), frame.color = std::move(images.color);
    } else {
      const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
      frame.depth.assign(pixels, 0.0f), frame.color.assign(pixels, 0xff000000u);
    }
    if (has_gyroscope) frame.gyro = gyroscope(path, (i - step) / 30.0, time);
    if (spoil) spoil(i, frame);
    if (!start) start = truth;
    outcome.reports.push_back(mapper.add(frame));
    if (outcome.reports.back().state != FrameState::fused) continue;
    const Eigen::Isometry3d found = *start * mapper.trajectory().back().world_from_camera;
    const double error = (found.translation() - truth.translation()).norm();
    outcome.last_error = error;
    ++outcome.fused;
    outcome.wrong += error > kWrong;
    squared += error * error;
  }
  outcome.warnings = mapper.warnings().size();
  outcome.rmse = std::sqrt(squared / std::max(outcome.fused, 1));
  ::testing::Test::RecordProperty("rmse_mm", std::to_string(1000 * outcome.rmse));
  std::printf("%d of %zu frames fused, %d wrong, RMSE %.1f mm, %.1f mm at the end\n", outcome.fused,
              outcome.reports.size(), outcome.wrong, 1000 * outcome.rmse, 1000 * outcome.last_error);
  return outcome;
}

const Scene& room() {
  static const Scene scene = synthetic_scene("room");
  return scene;
}
Eigen::Isometry3d along(double seconds) { return room().world_from_camera(seconds); }

/// Number of frames from `first` on until a frame is fused.
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

TEST(Robustness, AGyroscopeCarriesThroughAWhipPanInTheDark) {
  // 150 degrees in half a second; the middle five frames are black.
  const auto pan = [](double t) {
    const double turned = std::clamp((t - 0.5) / 0.5, 0.0, 1.0) * 150 * std::numbers::pi / 180;
    return along(std::min(t, 0.5) + std::max(0.0, t - 1.0)) * Eigen::AngleAxisd(turned, Eigen::Vector3d::UnitY());
  };
  const auto o = run(
      room(), 60, pan, {}, [](int i) { return i < 20 || i >= 25; }, 1, true);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_EQ(o.fused, 55);
  EXPECT_EQ(frames_until_found(o, 25), 0);
  EXPECT_LE(o.last_error, 0.01);
}

TEST(Robustness, AGyroscopeCarriesAlongABareWall) {
  // The camera turns from furniture to a wall without texture, sways for two seconds, and turns back.
  Scene scene{.name = "bare wall"};
  scene.solids.push_back(
      {.shape = Scene::Shape::box, .center = {0, 0, 2}, .half_size = {6, 4, 0.5f}, .color = {9, 9, 9}});
  scene.solids.push_back({.shape = Scene::Shape::box,
                          .center = {-2.3f, 0, 0},
                          .half_size = {0.5f, 4, 6},
                          .pattern = Scene::Pattern::patches});
  for (int k = 0; k < 6; ++k)
    scene.solids.push_back(
        {.shape = Scene::Shape::box,
         .center = {-1.5f, 0.7f - 0.3f * static_cast<float>(k), -0.8f + 0.3f * static_cast<float>(k)},
         .half_size = {0.2f, 0.12f, 0.15f},
         .pattern = Scene::Pattern::checker});
  const auto path = [](double t) {
    // Only the wall is visible within 20 degrees of its normal.
    const double turned = t < 1 ? 0.0 : t < 2.5 ? (t - 1) / 1.5 : t < 4.5 ? 1.0 : t < 6 ? 1 - (t - 4.5) / 1.5 : 0.0;
    const double smooth = turned * turned * (3 - 2 * turned);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Eigen::Vector3d(0.02 * std::sin(2.1 * t), 0.015 * std::sin(2.9 * t), 0.01 * std::sin(1.7 * t));
    pose.rotate(Eigen::AngleAxisd((smooth - 1) * 80 * std::numbers::pi / 180, Eigen::Vector3d::UnitY()));
    pose.rotate(Eigen::AngleAxisd(0.05 * std::sin(2.3 * t), Eigen::Vector3d::UnitZ()));
    return pose;
  };
  const auto o = run(scene, 200, path, {}, {}, 1, true);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_LE(o.last_error, 0.02);
}

/// The room's path at 1.5 times its speed: 0.3 m/s and 60 degrees a second.
Eigen::Isometry3d at_hand_speed(double seconds) { return along(1.5 * seconds); }

TEST(Robustness, InertialSensorsCarryThroughOneAndTwoSecondsOfDarkness) {
  for (const int dark : {30, 60}) {
    const auto o = run(
        room(), 225 + dark, at_hand_speed, with_accelerometer(at_hand_speed),
        [&](int i) { return i < 180 || i >= 180 + dark; }, 1, true);
    EXPECT_EQ(o.wrong, 0);
    EXPECT_EQ(o.fused, 225 + dark - dark);
    EXPECT_EQ(frames_until_found(o, 180 + dark), 0);
    EXPECT_EQ(o.reports[static_cast<std::size_t>(180 + dark)].guess, InitialGuess::motion);
    EXPECT_LE(o.rmse, 0.01);
  }
}

TEST(Robustness, InertialSensorsCarryAlongTwoMetersOfBareWall) {
  // Furniture in front of a wall without texture at both ends of a path of 3.4 m; only the wall is visible for 2 m.
  Scene scene{.name = "bare wall"};
  scene.solids.push_back(
      {.shape = Scene::Shape::box, .center = {2, 0, 2}, .half_size = {8, 4, 0.5f}, .color = {9, 9, 9}});
  for (const float end : {-0.6f, 4.6f})
    for (int k = 0; k < 6; ++k)
      scene.solids.push_back({.shape = Scene::Shape::box,
                              .center = {end + 0.12f * static_cast<float>(k % 2), 0.7f - 0.3f * static_cast<float>(k),
                                         1.3f - 0.08f * static_cast<float>(k % 3)},
                              .half_size = {0.35f, 0.12f, 0.15f},
                              .pattern = Scene::Pattern::checker});
  const auto path = [](double t) {
    const double share = std::clamp((t - 6) / 4, 0.0, 1.0);
    const double smooth = share * share * share * (10 - 15 * share + 6 * share * share);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() =
        Eigen::Vector3d(4.0 * smooth + 0.12 * std::sin(2.1 * t), 0.10 * std::sin(2.9 * t), 0.08 * std::sin(1.7 * t));
    pose.rotate(Eigen::AngleAxisd(0.15 * std::sin(1.9 * t), Eigen::Vector3d::UnitY()));
    pose.rotate(Eigen::AngleAxisd(0.10 * std::sin(2.3 * t), Eigen::Vector3d::UnitX()));
    return pose;
  };
  const auto o = run(scene, 330, path, with_accelerometer(path), {}, 1, true);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_LE(o.last_error, 0.03);
}

TEST(Robustness, InertialSensorsOfAnotherCameraAreNotUsed) {
  const Path other = [](double t) { return along(20 - t); };
  const auto none = run(room(), 180, at_hand_speed);
  const std::pair<const char*, Spoil> wrongs[] = {{"sign",
                                                   [](int, Frame& f) {
                                                     for (auto& a : f.accelerations) a.value = -a.value;
                                                   }},
                                                  {"axes",
                                                   [](int, Frame& f) {
                                                     for (auto& a : f.accelerations)
                                                       std::swap(a.value.x(), a.value.y());
                                                     for (auto& r : f.gyro) std::swap(r.rate.x(), r.rate.y());
                                                   }},
                                                  {"clock",
                                                   [](int, Frame& f) {
                                                     for (auto& a : f.accelerations) a.timestamp -= 0.2;
                                                     for (auto& r : f.gyro) r.timestamp -= 0.2;
                                                   }},
                                                  {"another recording", [&](int i, Frame& f) {
                                                     f.gyro = gyroscope(other, (i - 1) / 30.0, i / 30.0);
                                                     f.accelerations = accelerometer(other, f.gyro);
                                                   }}};
  for (const auto& [name, spoil] : wrongs) {
    const auto wrong = run(room(), 180, at_hand_speed, with_accelerometer(at_hand_speed, spoil), {}, 1, true);
    EXPECT_EQ(wrong.wrong, 0) << name;
    EXPECT_EQ(wrong.fused, 180) << name;
    EXPECT_LE(wrong.rmse, 1.1 * none.rmse) << name;
    EXPECT_EQ(wrong.warnings, 1) << name;
  }
}

/// True relative motion of the camera in another world, with an odometry drift of half a percent.
Spoil guessed_along(const Path& path) {
  return [path](int i, Frame& frame) {
    const Eigen::Isometry3d elsewhere(Eigen::Translation3d(3, -1, 2) *
                                      Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitY()));
    Eigen::Isometry3d pose = path(i / 30.0);
    pose.translation() *= 1.005;
    frame.guess = elsewhere * pose;
  };
}

TEST(Robustness, AGuessCarriesThroughTheDark) {
  // A second of darkness, while the camera continues along its path.
  const auto o = run(room(), 90, along, guessed_along(along), [](int i) { return i < 30 || i >= 60; });
  EXPECT_EQ(o.wrong, 0);
  EXPECT_EQ(frames_until_found(o, 60), 0);
  EXPECT_EQ(o.fused, 60);
  EXPECT_LE(o.rmse, 0.01);
}

TEST(Robustness, AWrongGuessIsNotWorseThanNone) {
  const auto backwards = [](double t) { return along(3 - t).inverse(); };
  const auto none = run(room(), 60, along);
  const auto wrong = run(room(), 60, along, guessed_along(backwards));
  EXPECT_EQ(wrong.wrong, 0);
  EXPECT_EQ(wrong.fused, 60);
  EXPECT_LE(wrong.rmse, 1.05 * none.rmse);
}

TEST(Robustness, Kidnapped) {
  // There and back; the middle third is dark while the camera moves elsewhere.
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
  // The driver repeats an image for half a second while the camera moves on.
  Frame kept;
  const auto o = run(room(), 60, along, [&](int i, Frame& frame) {
    if (i == 20) kept = frame;
    if (i > 20 && i < 35) frame.depth = kept.depth, frame.color = kept.color;
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
        for (auto& pixel : frame.color) {
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

TEST(Robustness, ColorThatEndsHalfWayOrHasAnotherSize) {
  const auto o = run(
      room(), 60, along,
      [](int i, Frame& frame) {
        if (i >= 20 && i < 40) frame.color.resize(frame.color.size() / 4);
        if (i >= 40) frame.color.clear();
      },
      {}, 2);
  EXPECT_EQ(o.fused, 30);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_LE(o.rmse, 0.01);
  EXPECT_NE(o.reports[13].reason.find("only depth is used"), std::string::npos);
  EXPECT_EQ(o.reports[25].fit.photometric_share, 0);
}

TEST(Robustness, SomebodyWalksThroughTheRoom) {
  // In front of the camera, at 1.2 m, into a part of the room not yet mapped.
  const auto o = run(synthetic_scene("room-with-mover"), 90, along, {}, {}, 2);
  EXPECT_EQ(o.wrong, 0);
  EXPECT_EQ(o.fused, 45);
  EXPECT_LE(o.rmse, 0.015);  // 6.6 to 12.2 mm, depending on the noise's seed
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
  // Two seconds of the path; then carried in the dark to an unmapped place, and back from there.
  std::vector<double> way;
  for (int i = 0; i < 20; ++i) way.push_back(i / 10.0);
  for (int i = 0; i < 73; ++i) way.push_back(8.0 - i / 10.0);
  Trajectory truth;
  int lost = 0, pieces_at_most = 0;
  for (std::size_t i = 0; i < way.size(); ++i) {
    truth.push_back({static_cast<double>(i) / 10.0, scene.world_from_camera(way[i])});
    auto images = renderer.render(truth.back().world_from_camera);
    add_noise(images, camera, "kinect", 1, static_cast<int>(i));
    const FrameReport report = mapper.add({.index = static_cast<int>(i),
                                           .timestamp = truth.back().timestamp,
                                           .depth = std::move(images.depth),
                                           .color = std::move(images.color)});
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
