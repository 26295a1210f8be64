// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "adjust/bundle.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr double kReadout = 0.028, kFrameRate = 5;  // seconds; Hz

/// The room's own place, and a camera that swings in it as a hand does: up to a radian a second.
struct Swing {
  Scene scene = synthetic_scene("room");
  [[nodiscard]] Eigen::Isometry3d operator()(double t) const {
    Eigen::Isometry3d pose = scene.world_from_camera(0.3 * t);
    pose.rotate(Eigen::AngleAxisd(0.25 * std::sin(4.0 * t), Eigen::Vector3d::UnitX()));
    pose.rotate(Eigen::AngleAxisd(0.25 * std::sin(2.9 * t), Eigen::Vector3d::UnitY()));
    return pose;
  }
  [[nodiscard]] Vector6d velocity(double t) const {
    constexpr double kStep = 0.005;
    return local_coordinates((*this)(t - kStep).inverse() * (*this)(t + kStep)) / (2 * kStep);
  }
};

struct Views {
  std::vector<Frame> frames;
  std::vector<Eigen::Isometry3d> poses;  // true
  std::vector<Vector6d> velocities;
};

Views swinging_views(int count, double readout) {
  const Swing swing;
  Camera camera = synthetic_camera();
  camera.readout = readout;
  SceneRenderer renderer(test_device(), swing.scene, camera);
  Views views;
  for (int i = 0; i < count; ++i) {
    const double time = 1 + i / kFrameRate;
    auto images = renderer.render([&](double t) { return swing(t); }, time);
    add_noise(images, camera, "kinect", 1, i);
    views.frames.push_back({.index = i, .timestamp = time, .depth = images.depth, .colour = images.colour});
    views.poses.push_back(swing(time));
    views.velocities.push_back(swing.velocity(time));
  }
  return views;
}

/// By a few millimetres and milliradians, another way in each view; the first one stays.
Eigen::Isometry3d misplaced(std::size_t i) {
  if (i == 0) return Eigen::Isometry3d::Identity();
  const auto wave = [&](double k) { return std::sin(k * static_cast<double>(i)); };
  Vector6d x;
  x << 0.004 * wave(1.1), 0.004 * wave(2.3), 0.004 * wave(3.7), 0.006 * wave(1.9), 0.006 * wave(2.7), 0.006 * wave(0.7);
  return retract(x);
}

/// Metres and radians, root mean square.
std::pair<double, double> errors(const std::vector<Eigen::Isometry3d>& found,
                                 const std::vector<Eigen::Isometry3d>& truth) {
  double metres = 0, radians = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Eigen::Isometry3d off = truth[i].inverse() * found[i];
    metres += off.translation().squaredNorm();
    radians += std::pow(Eigen::AngleAxisd(off.linear()).angle(), 2);
  }
  const auto count = static_cast<double>(truth.size());
  return {std::sqrt(metres / count), std::sqrt(radians / count)};
}

Bundle bundle_of(const Views& views, const std::vector<Eigen::Isometry3d>& poses) {
  Bundle bundle(synthetic_camera());
  for (std::size_t i = 0; i < views.frames.size(); ++i) bundle.add(views.frames[i], views.velocities[i], poses[i]);
  return bundle;
}

TEST(Bundle, MovesViewsToWhereAllTheySeeAgrees) {
  const Views views = swinging_views(14, 0);
  std::vector<Eigen::Isometry3d> poses;
  for (std::size_t i = 0; i < views.poses.size(); ++i) poses.push_back(views.poses[i] * misplaced(i));
  Bundle bundle = bundle_of(views, poses);
  bundle.adjust(true);
  const auto before = errors(poses, views.poses), after = errors(bundle.world_from_view(), views.poses);
  std::printf("%.2f -> %.2f mm, %.2f -> %.2f mrad, readout %.2f +- %.2f ms, clock %.2f ms\n", 1000 * before.first,
              1000 * after.first, 1000 * before.second, 1000 * after.second, 1000 * bundle.shutter().readout,
              1000 * bundle.readout_sigma(), 1000 * bundle.shutter().clock);
  EXPECT_LT(after.first, 0.0005);
  EXPECT_LT(after.second, 0.0005);
  EXPECT_NEAR(bundle.shutter().readout, 0, 0.001);
  EXPECT_NEAR(bundle.shutter().clock, 0, 0.001);
}

TEST(Bundle, FindsHowLongTheShutterTakesAndPredictsBetterWithIt) {
  const Views views = swinging_views(14, kReadout);
  Bundle bundle = bundle_of(views, views.poses), global = bundle;
  bundle.adjust(true), global.adjust(false);
  const double with = bundle.held_out_error(), without = global.held_out_error();
  std::printf("readout %.2f +- %.2f ms, held out %.4f against %.4f\n", 1000 * bundle.shutter().readout,
              1000 * bundle.readout_sigma(), with, without);
  EXPECT_NEAR(bundle.shutter().readout, kReadout, 0.002);
  EXPECT_LT(bundle.readout_sigma(), 0.001);
  EXPECT_NEAR(global.shutter().readout, 0, 1e-6);
  EXPECT_LT(with, 0.97 * without);
  EXPECT_LT(errors(bundle.world_from_view(), views.poses).second,
            0.5 * errors(global.world_from_view(), views.poses).second);
}

TEST(Bundle, GivesTheSameBitsAgain) {
  const Views views = swinging_views(6, 0);
  Bundle a = bundle_of(views, views.poses), b = bundle_of(views, views.poses);
  a.adjust(true), b.adjust(true);
  for (std::size_t i = 0; i < views.poses.size(); ++i)
    EXPECT_EQ(a.world_from_view()[i].matrix(), b.world_from_view()[i].matrix());
  EXPECT_EQ(a.shutter().readout, b.shutter().readout);
}

TEST(Bundle, LeavesViewsThatShareNothingWhereTheyAre) {
  Views views = swinging_views(2, 0);
  views.frames[1].depth.assign(views.frames[1].depth.size(), 0.0f);
  Bundle bundle = bundle_of(views, views.poses);
  bundle.adjust(true);
  EXPECT_EQ(bundle.surfels(), 0u);
  EXPECT_EQ(bundle.world_from_view()[1].matrix(), views.poses[1].matrix());
  EXPECT_EQ(bundle.shutter().readout, 0);
}

}  // namespace
}  // namespace cairn
