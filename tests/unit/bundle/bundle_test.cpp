// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "bundle/bundle.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr double kReadout = 0.028, kFrameRate = 5;  // seconds; Hz
constexpr double kEdgeSigma = 0.01;                 // rad, m: weak edges

/// Motion of a camera, in its own frame.
CameraMotion motion_at(const PoseAt& pose, double t) {
  constexpr double kStep = 0.005;
  const Vector6d after = local_coordinates(pose(t).inverse() * pose(t + kStep)),
                 before = local_coordinates(pose(t).inverse() * pose(t - kStep));
  return {.velocity = (after - before) / (2 * kStep), .acceleration = (after + before) / (kStep * kStep)};
}

struct Views {
  std::vector<Frame> frames;
  std::vector<Eigen::Isometry3d> poses;  // true
  std::vector<CameraMotion> motions;
};

Views swinging_views(int count, double readout, int seed = 1) {
  const Scene scene = synthetic_scene("room");
  const PoseAt pose = swung_in(scene);
  Camera camera = synthetic_camera();
  camera.readout = readout;
  SceneRenderer renderer(test_device(), scene, camera);
  Views views;
  for (int i = 0; i < count; ++i) {
    const double time = 1 + i / kFrameRate;
    auto images = renderer.render(pose, time);
    add_noise(images, camera, "kinect", seed, i);
    views.frames.push_back({.index = i, .timestamp = time, .depth = images.depth, .color = images.color});
    views.poses.push_back(pose(time));
    views.motions.push_back(motion_at(pose, time));
  }
  return views;
}

/// Perturbation by a few millimeters and milliradians, different in each view; none for the first.
Eigen::Isometry3d misplaced(std::size_t i) {
  if (i == 0) return Eigen::Isometry3d::Identity();
  const auto wave = [&](double k) { return std::sin(k * static_cast<double>(i)); };
  Vector6d x;
  x << 0.004 * wave(1.1), 0.004 * wave(2.3), 0.004 * wave(3.7), 0.006 * wave(1.9), 0.006 * wave(2.7), 0.006 * wave(0.7);
  return retract(x);
}

/// Root mean square errors in meters and radians.
std::pair<double, double> errors(const std::vector<Eigen::Isometry3d>& found,
                                 const std::vector<Eigen::Isometry3d>& truth) {
  double meters = 0, radians = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Eigen::Isometry3d off = truth[i].inverse() * found[i];
    meters += off.translation().squaredNorm();
    radians += std::pow(Eigen::AngleAxisd(off.linear()).angle(), 2);
  }
  const auto count = static_cast<double>(truth.size());
  return {std::sqrt(meters / count), std::sqrt(radians / count)};
}

Bundle bundle_of(const Views& views, const std::vector<Eigen::Isometry3d>& poses) {
  Bundle bundle(synthetic_camera());
  for (std::size_t i = 0; i < views.frames.size(); ++i) bundle.add(views.frames[i], views.motions[i], poses[i]);
  return bundle;
}

void adjust(Bundle& bundle, bool finds_readout) {
  for (const auto detail : {Bundle::Detail::coarse, Bundle::Detail::fine}) bundle.adjust(finds_readout, detail);
}

TEST(Bundle, MovesViewsToAgreeingPoses) {
  const Views views = swinging_views(14, 0);
  std::vector<Eigen::Isometry3d> poses;
  for (std::size_t i = 0; i < views.poses.size(); ++i) poses.push_back(views.poses[i] * misplaced(i));
  Bundle bundle = bundle_of(views, poses);
  adjust(bundle, true);
  const auto before = errors(poses, views.poses), after = errors(bundle.world_from_view(), views.poses);
  std::printf("%.2f -> %.2f mm, %.2f -> %.2f mrad, readout %.2f +- %.2f ms, clock %.2f ms\n", 1000 * before.first,
              1000 * after.first, 1000 * before.second, 1000 * after.second, 1000 * bundle.shutter().readout,
              1000 * bundle.readout_sigma(), 1000 * bundle.shutter().clock);
  EXPECT_LT(after.first, 0.0005);
  EXPECT_LT(after.second, 0.0005);
  EXPECT_NEAR(bundle.shutter().readout, 0, 0.001);
  EXPECT_NEAR(bundle.shutter().clock, 0, 0.001);
}

TEST(Bundle, ViewsFollowAdjustedNeighbors) {
  const Views views = swinging_views(14, 0);
  std::vector<Eigen::Isometry3d> poses;
  for (std::size_t i = 0; i < views.poses.size(); ++i) poses.push_back(views.poses[i] * misplaced(i / 2));
  Bundle bundle = bundle_of(views, poses);
  for (std::size_t i = 1; i < poses.size(); ++i)
    bundle.add_edge({.i = i - 1,
                     .j = i,
                     .i_from_j = poses[i - 1].inverse() * poses[i],
                     .information = Matrix6d::Identity() / (kEdgeSigma * kEdgeSigma)});
  Bundle second = bundle.every_second();
  ASSERT_EQ(second.views(), 8);  // with the last
  second.adjust(false, Bundle::Detail::coarse);
  bundle.follow(second);
  for (std::size_t view = 0; view < second.views(); ++view)
    EXPECT_TRUE(bundle.world_from_view()[std::min<std::size_t>(2 * view, 13)].isApprox(second.world_from_view()[view]));
  const auto before = errors(poses, views.poses), after = errors(bundle.world_from_view(), views.poses);
  EXPECT_LT(after.first, 0.7 * before.first);
  EXPECT_LT(after.second, 0.7 * before.second);
  bundle.adjust(false, Bundle::Detail::fine);
  const auto fine = errors(bundle.world_from_view(), views.poses);
  EXPECT_LT(fine.first, 0.0005);
  EXPECT_LT(fine.second, 0.0005);
}

TEST(Bundle, ComposesTheEdgesOfEachKind) {
  const Views views = swinging_views(6, 0);
  Bundle bundle = bundle_of(views, views.poses);
  for (std::size_t i = 1; i < 6; ++i)
    for (const bool by_device : {true, false}) {
      if (by_device && i == 3) continue;  // a device without a pose of view 3
      Eigen::Isometry3d step = views.poses[i - 1].inverse() * views.poses[i];
      if (by_device) step.translation().x() += 0.01;
      bundle.add_edge({.i = i - 1, .j = i, .i_from_j = step, .heavy_tailed = by_device});
    }
  const Bundle second = bundle.every_second();  // views 0, 2, 4, 5
  std::vector<std::pair<std::size_t, bool>> kinds;
  for (const auto& edge : second.edges()) {
    EXPECT_EQ(edge.j, edge.i + 1);
    kinds.emplace_back(edge.i, edge.heavy_tailed);
    const Eigen::Isometry3d truth = second.world_from_view()[edge.i].inverse() * second.world_from_view()[edge.j];
    EXPECT_EQ(edge.i_from_j.isApprox(truth, 1e-6), !edge.heavy_tailed);
  }
  EXPECT_EQ(kinds,
            (std::vector<std::pair<std::size_t, bool>>{{0, false}, {0, true}, {1, false}, {2, false}, {2, true}}));
}

// Brightness is interpolated between pixels: the interpolation error must not depend on a surfel's source view.
TEST(Bundle, KeepsExactPoses) {
  const Scene scene = synthetic_scene("room");
  const Camera camera = synthetic_camera();
  SceneRenderer renderer(test_device(), scene, camera);
  Bundle bundle(camera);
  std::vector<Eigen::Isometry3d> poses;
  for (int i = 0; i < 14; ++i) {
    const double time = 4.4 + i / kFrameRate;
    poses.push_back(scene.world_from_camera(time));
    const auto images = renderer.render(poses.back(), time);
    bundle.add({.index = i, .timestamp = time, .depth = images.depth, .color = images.color}, {}, poses.back());
  }
  adjust(bundle, false);
  const auto after = errors(bundle.world_from_view(), poses);
  std::printf("%.3f mm, %.3f mrad\n", 1000 * after.first, 1000 * after.second);
  EXPECT_LT(after.first, 0.0002);
  EXPECT_LT(after.second, 0.0001);
}

// Normalized estimation error squared (Bar-Shalom, Li & Kirubarajan 2001, 5.4): 6 per view on average. Errors of the
// views are not independent, since all contain the error of the first; so the bounds are wider than of a chi-square.
TEST(Bundle, EstimatesTheCovarianceOfItsErrors) {
  double sum = 0, of_steps = 0, count = 0;
  for (const int seed : {1, 2, 3}) {
    const Views views = swinging_views(12, 0, seed);
    Bundle bundle = bundle_of(views, views.poses);
    adjust(bundle, false);
    const auto covariance = bundle.covariance();
    ASSERT_TRUE(covariance.has_value());
    EXPECT_LT(covariance->of_views[0].norm(), 1e-10);  // fixed
    const auto& found = bundle.world_from_view();
    double of_seed = 0;
    for (std::size_t i = 1; i < found.size(); ++i) {
      const Vector6d off =
          local_coordinates((found[0].inverse() * found[i]).inverse() * views.poses[0].inverse() * views.poses[i]);
      of_seed += off.dot(covariance->of_views[i].ldlt().solve(off));
      const Vector6d of_step = local_coordinates((found[i - 1].inverse() * found[i]).inverse() *
                                                 views.poses[i - 1].inverse() * views.poses[i]);
      of_steps += of_step.dot(covariance->of_steps[i].ldlt().solve(of_step));
    }
    std::printf("seed %d: %.2f\n", seed, of_seed / static_cast<double>(found.size() - 1) / 6);
    sum += of_seed, count += static_cast<double>(found.size() - 1);
  }
  std::printf("normalized error squared %.2f of 1, of steps %.2f\n", sum / count / 6, of_steps / count / 6);
  for (const double normalized : {sum / count / 6, of_steps / count / 6}) {
    EXPECT_GT(normalized, 0.5);
    EXPECT_LT(normalized, 2);
  }
}

TEST(Bundle, EstimatesTheReadoutAndPredictsBetterWithIt) {
  const Views views = swinging_views(14, kReadout);
  Bundle bundle = bundle_of(views, views.poses), global = bundle;
  adjust(bundle, true), adjust(global, false);
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

/// Depth error of a Kinect: stripes, proportional to the square of depth.
float true_offset(const Camera& camera, int x) {
  return 0.004f * std::sin(12.0f * static_cast<float>(x) / static_cast<float>(camera.width));
}

TEST(Bundle, EstimatesTheDepthCorrectionAndPredictsBetterWithIt) {
  const Camera camera = synthetic_camera();
  Views views = swinging_views(28, 0);
  for (Frame& frame : views.frames)
    for (std::size_t i = 0; i < frame.depth.size(); ++i)
      frame.depth[i] /= 1 - frame.depth[i] * true_offset(camera, static_cast<int>(i) % camera.width);
  Bundle bundle = bundle_of(views, views.poses), corrected = bundle;
  corrected.find_correction();
  adjust(bundle, false), adjust(corrected, false);
  EXPECT_LT(corrected.held_out_error(), 0.95 * bundle.held_out_error());
  const DepthCorrection& found = corrected.correction();
  double squared = 0, error = 0, mean = 0;
  int count = 0;
  for (int j = found.rows / 4; j < 3 * found.rows / 4; ++j)
    for (int i = 2; i < found.columns - 2; ++i, ++count) {
      const double truth = true_offset(camera, (2 * i + 1) * camera.width / (2 * found.columns));
      const double off = found.offsets[static_cast<std::size_t>(j * found.columns + i)] - truth;
      squared += truth * truth, error += off * off, mean += off;
    }
  std::printf("correction: RMS %.5f, error %.5f (mean %.5f) 1/m\n", std::sqrt(squared / count),
              std::sqrt(error / count), mean / count);
  EXPECT_LT(std::sqrt(error / count), 0.1 * std::sqrt(squared / count));
  EXPECT_LT(errors(corrected.world_from_view(), views.poses).first,
            errors(bundle.world_from_view(), views.poses).first);
}

/// Camera with unknown errors of calibration.
struct WrongCamera {
  Camera camera = synthetic_camera();
  double clock = 0.015;
  WrongCamera() {
    camera.fx *= 1.01, camera.fy *= 1.01;
    camera.cx += 3, camera.cy -= 2;
    camera.distortion[0] = 0.05;
    camera.readout = kReadout;
  }
};

Views views_of(const WrongCamera& wrong, int count) {
  const Scene scene = synthetic_scene("room");
  const PoseAt pose = swung_in(scene);
  SceneRenderer renderer(test_device(), scene, wrong.camera);
  Views views;
  for (int i = 0; i < count; ++i) {
    const double time = 1 + i / kFrameRate;
    auto images = renderer.render(pose, time);
    images.color = renderer.render(pose, time - wrong.clock).color;
    add_noise(images, wrong.camera, "kinect", 1, i);
    for (std::size_t p = 0; p < images.depth.size(); ++p)
      images.depth[p] /= 1 - images.depth[p] * true_offset(wrong.camera, static_cast<int>(p) % wrong.camera.width);
    views.frames.push_back({.index = i, .timestamp = time, .depth = images.depth, .color = images.color});
    views.poses.push_back(pose(time));
    views.motions.push_back(motion_at(pose, time));
  }
  return views;
}

TEST(Bundle, EstimatesTheCameras) {
  const WrongCamera wrong;
  const Views views = views_of(wrong, 28);
  Bundle without_cameras = bundle_of(views, views.poses), bundle = without_cameras;
  bundle.find_cameras();
  bundle.find_correction(), without_cameras.find_correction();
  bundle.adjust(true, Bundle::Detail::medium), without_cameras.adjust(true, Bundle::Detail::medium);
  const Camera found = bundle.rig().depth;
  std::printf("f %.2f %.2f, c %.2f %.2f, k1 %.4f, readout %.2f +- %.2f ms, clock %.2f ms\n", found.fx, found.fy,
              found.cx, found.cy, found.distortion[0], 1000 * bundle.shutter().readout, 1000 * bundle.readout_sigma(),
              1000 * bundle.shutter().clock);
  EXPECT_NEAR(found.fx, wrong.camera.fx, 0.001 * wrong.camera.fx);
  EXPECT_NEAR(found.fy, wrong.camera.fy, 0.001 * wrong.camera.fy);
  EXPECT_NEAR(found.cx, wrong.camera.cx, 0.5);
  EXPECT_NEAR(found.cy, wrong.camera.cy, 0.5);
  EXPECT_NEAR(found.distortion[0], wrong.camera.distortion[0], 0.002);
  EXPECT_NEAR(bundle.shutter().readout, kReadout, 0.0005);
  EXPECT_NEAR(bundle.shutter().clock, wrong.clock, 0.0002);
  EXPECT_LT(bundle.held_out_error(), 0.9 * without_cameras.held_out_error());
}

TEST(Bundle, IsDeterministic) {
  const Views views = swinging_views(6, 0);
  Bundle a = bundle_of(views, views.poses), b = bundle_of(views, views.poses);
  adjust(a, true), adjust(b, true);
  for (std::size_t i = 0; i < views.poses.size(); ++i)
    EXPECT_EQ(a.world_from_view()[i].matrix(), b.world_from_view()[i].matrix());
  EXPECT_EQ(a.shutter().readout, b.shutter().readout);
}

TEST(Bundle, KeepsViewsWithoutOverlap) {
  Views views = swinging_views(2, 0);
  views.frames[1].depth.assign(views.frames[1].depth.size(), 0.0f);
  Bundle bundle = bundle_of(views, views.poses);
  adjust(bundle, true);
  EXPECT_EQ(bundle.surfels(), 0u);
  EXPECT_EQ(bundle.world_from_view()[1].matrix(), views.poses[1].matrix());
  EXPECT_EQ(bundle.shutter().readout, 0);
}

}  // namespace
}  // namespace cairn
