// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "alignment/align.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <utility>

#include "preprocess/preprocess.hpp"
#include "support/scenes.hpp"
#include "support/twins.hpp"
#include "volume/integrate.hpp"
#include "volume/raycast.hpp"

namespace cairn {
namespace {

/// Processing stages from a frame to its alignment.
struct Stages {
  Camera camera = small_camera();
  TrackOptions options{.finest_level = 0};
  Preprocessor preprocessor{test_device(), camera, {}, options.levels, 0};
  Volume volume{test_device(), {.voxel_size = 0.01f, .truncation = 0.04f, .device_memory = 256 << 20}, 5.0f};
  Integrator integrator{test_device(), camera, {}};
  Raycaster raycaster{test_device(), camera, {}, options.levels, 0};
  Aligner aligner{test_device(), options};
};

/// Room fused from one exact frame.
struct Room : Stages {
  Scene scene = synthetic_scene("room");
  Frame frame = scene_frame(scene, camera, 0);
  Room() { integrator.integrate(preprocessor.preprocess(frame), *frame.world_from_camera, volume, 1); }
};

TEST(Align, StaysAtTheTruePose) {
  Room s;
  const FramePyramid live = s.preprocessor.preprocess(s.frame);
  const Eigen::Isometry3d pose = *s.frame.world_from_camera;
  const Alignment a = s.aligner.align(live, s.raycaster.raycast(s.volume, pose), pose);
  EXPECT_TRUE(a.converged()) << to_string(a.lost);
  const Eigen::Isometry3d error = pose.inverse() * a.submap_from_camera;
  EXPECT_LT(error.translation().norm(), 1e-3);  // a tenth of a voxel: the filter rounds corners, the model does not
  EXPECT_LT(Eigen::AngleAxisd(error.linear()).angle(), 1e-3);
  EXPECT_GT(a.fit.inlier_share, 0.9);
}

TEST(Align, RecoversTheTruePose) {
  Room s;
  // 5 cm and 4 degrees: a fast hand motion between two frames.
  Eigen::Isometry3d guess = *s.frame.world_from_camera;
  guess = guess * Eigen::Translation3d(0.03, -0.02, 0.035) *
          Eigen::AngleAxisd(0.07, Eigen::Vector3d(1, 2, -1).normalized());
  const FramePyramid live = s.preprocessor.preprocess(s.frame);
  const Alignment a = s.aligner.align(live, s.raycaster.raycast(s.volume, guess), guess);
  EXPECT_TRUE(a.converged()) << to_string(a.lost);
  const Eigen::Isometry3d error = s.frame.world_from_camera->inverse() * a.submap_from_camera;
  EXPECT_LT(error.translation().norm(), 2e-3);
  EXPECT_LT(Eigen::AngleAxisd(error.linear()).angle(), 2e-3);
}

TEST(Align, RejectsAnotherPlaceByBrightness) {
  // Walls match walls: by depth alone every second of these places would be mistaken for the reference.
  constexpr double kTypicalRmse = 0.03;  // photometric rmse of correctly aligned frames
  Room s;
  const FramePyramid reference_frame = s.preprocessor.preprocess(s.frame);
  const Eigen::Isometry3d guess = *s.frame.world_from_camera;
  PhotometricKeyframe keyframe(test_device(), s.camera, s.options);
  keyframe.set(reference_frame, guess, {});
  const Alignment here = s.aligner.align(reference_frame, s.raycaster.raycast(s.volume, guess), guess, &keyframe);
  EXPECT_TRUE(here.converged()) << to_string(here.lost);
  EXPECT_LT(here.fit.photometric_rmse, kTypicalRmse / 3);
  for (int i = 100; i <= 620; i += 40) {  // all around the room
    const Frame elsewhere = scene_frame(s.scene, s.camera, i);
    const FramePyramid live = s.preprocessor.preprocess(elsewhere);
    const Alignment a = s.aligner.align(live, s.raycaster.raycast(s.volume, guess), guess, &keyframe);
    EXPECT_TRUE(!a.converged() || a.fit.photometric_rmse > 3 * kTypicalRmse) << i << ": " << a.fit.photometric_rmse;
  }
}

TEST(Align, ReportsMissingDepth) {
  Room s;
  Frame dark = s.frame;
  std::fill(dark.depth.begin(), dark.depth.end(), 0.0f);
  const FramePyramid live = s.preprocessor.preprocess(dark);
  const Eigen::Isometry3d guess = *s.frame.world_from_camera;
  EXPECT_EQ(s.aligner.align(live, s.raycaster.raycast(s.volume, guess), guess).lost, FrameCause::little_depth);
}

TEST(IcpReduce, EqualsItsPlainTwin) {
  Room s;
  TrackOptions one = s.options;
  one.levels = 1;
  one.iterations_finest = 1;  // the information of a result is from its last linearization
  Aligner aligner(test_device(), one);
  const FramePyramid live = s.preprocessor.preprocess(s.frame);
  Eigen::Isometry3d guess = *s.frame.world_from_camera * Eigen::Translation3d(0.01, 0.005, -0.01);
  const SurfacePrediction model = s.raycaster.raycast(s.volume, guess);
  const Eigen::Isometry3d start = *s.frame.world_from_camera;
  const Alignment a = aligner.align(live, model, start);

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
      const double sigma = SensorModel{}.sigma(static_cast<float>(z)), r = n.dot(gap) / sigma;
      Eigen::Matrix<double, 6, 1> j;
      j << p.cross(n) / sigma, n / sigma;
      expected += std::min(1.0, one.huber / std::max(std::abs(r), 1e-6)) * j * j.transpose();
    }
  const Matrix6d information = a.fit.rmse * a.fit.rmse * a.information;  // in units of the depth noise
  EXPECT_LT((information - expected).norm() / expected.norm(), 1e-3);    // pixels on a border may match a neighbor
  EXPECT_GT(expected.norm(), 1e6);
}

/// Frames of a scene along a path, fused with their true poses except the last, which is aligned.
struct Slide : Stages {
  PhotometricKeyframe keyframe{test_device(), camera, options};

  /// Aligns the last frame from a guess 2 cm off along the camera's x.
  Alignment aside(const char* scene_name, bool with_color, bool noise = true) {
    const Scene scene = synthetic_scene(scene_name);
    for (int i = 0; i < 5; ++i) {
      const Frame frame = scene_frame(scene, camera, i, noise);
      const FramePyramid live = preprocessor.preprocess(frame);
      integrator.integrate(live, *frame.world_from_camera, volume, static_cast<std::uint32_t>(i + 1));
      if (i == 4 && with_color) keyframe.set(live, *frame.world_from_camera, {});
    }
    const Frame frame = scene_frame(scene, camera, 6, noise);
    truth = *frame.world_from_camera;
    const Eigen::Isometry3d guess = truth * Eigen::Translation3d(0.02, 0, 0);
    return aligner.align(preprocessor.preprocess(frame), raycaster.raycast(volume, guess), guess,
                         with_color ? &keyframe : nullptr);
  }
  Eigen::Isometry3d truth;
};

TEST(Align, NeedsTextureToHoldOnAWall) {
  Slide blind, seeing;
  const Alignment slid = blind.aside("plane", false), held = seeing.aside("plane", true);
  EXPECT_GT((blind.truth.inverse() * slid.submap_from_camera).translation().norm(), 0.01);
  // The visible content stays in place: a tilt about the point ahead is weakly constrained, with this noise and image
  // size.
  const Eigen::Vector3d ahead(0, 0, 2);
  EXPECT_LT((seeing.truth.inverse() * held.submap_from_camera * ahead - ahead).norm(), 0.003);
  EXPECT_LT((seeing.truth.inverse() * held.submap_from_camera).translation().norm(), 0.005);
  EXPECT_EQ(held.fit.unobserved, 0);
  EXPECT_GT(held.fit.photometric_share, 0.8);
}

TEST(Align, ReportsUnobservedDirectionsOfAWall) {
  Slide s;
  const Alignment a = s.aside("plane", false, false);
  EXPECT_EQ(a.fit.degenerate_directions, 3);  // two translations and the rotation about its normal
  EXPECT_EQ(a.fit.unobserved, 3);             // left at the guess
  EXPECT_NEAR((s.truth.inverse() * a.submap_from_camera).translation().x(), 0.02, 2e-3);
}

TEST(Align, FindsNoUnobservedDirectionInARoom) {
  Slide s;
  const Alignment a = s.aside("room", true);
  EXPECT_EQ(a.fit.degenerate_directions, 0);
  EXPECT_LT((s.truth.inverse() * a.submap_from_camera).translation().norm(), 0.003);
}

TEST(Align, CompensatesAChangeOfExposure) {
  Slide s;
  const Scene scene = synthetic_scene("plane");
  Frame first = scene_frame(scene, s.camera, 0), second = scene_frame(scene, s.camera, 2);
  for (auto& pixel : second.color) {
    std::uint32_t darker = 0xff000000u;
    for (int shift = 0; shift < 24; shift += 8) darker |= (((pixel >> shift) & 0xff) * 6 / 10 + 5) << shift;
    pixel = darker;
  }
  const FramePyramid key = s.preprocessor.preprocess(first);
  s.integrator.integrate(key, *first.world_from_camera, s.volume, 1);
  s.keyframe.set(key, *first.world_from_camera, {});
  const Eigen::Isometry3d guess = *second.world_from_camera * Eigen::Translation3d(0.01, 0.005, 0);
  const Alignment a =
      s.aligner.align(s.preprocessor.preprocess(second), s.raycaster.raycast(s.volume, guess), guess, &s.keyframe);
  EXPECT_NEAR(a.gain, 1 / 0.6, 0.05);
  EXPECT_LT((second.world_from_camera->inverse() * a.submap_from_camera).translation().norm(), 0.003);
}

TEST(Align, AccountsForAShutterCorrectionWithAnotherMotion) {
  // The guess assumed a static camera, but the camera moved: rows are off by the motion during the readout.
  Room s;
  constexpr double kInterval = 1 / 30.0;
  Rig rolling = s.camera;
  rolling.depth.readout = 0.028;
  Preprocessor preprocessor(test_device(), rolling, {}, s.options.levels, 0);
  Aligner aligner(test_device(), s.options, {}, true);
  const Eigen::Isometry3d before = *s.frame.world_from_camera;
  Vector6d step;
  step << 0.02, -0.03, 0.02, 0.01, -0.01, 0.008;
  const Eigen::Isometry3d now = before * retract(step);
  auto images = SceneRenderer(test_device(), s.scene, rolling.depth)
                    .render([&](double delay) { return now * retract(step * (delay / kInterval)); }, 0);
  const Frame frame{.depth = std::move(images.depth), .color = std::move(images.color)};
  const FramePyramid live = preprocessor.preprocess(frame);
  PhotometricKeyframe keyframe(test_device(), s.camera, s.options);
  keyframe.set(s.preprocessor.preprocess(s.frame), before, {});
  for (const PhotometricKeyframe* reference :
       {static_cast<const PhotometricKeyframe*>(nullptr), &std::as_const(keyframe)}) {
    const auto error = [&](const ShutterCorrection& correction) {
      const Alignment a = aligner.align(live, s.raycaster.raycast(s.volume, before), before, reference, {},
                                        AlignmentRange::coarse_to_fine, correction);
      EXPECT_TRUE(a.converged()) << to_string(a.lost);
      const Vector6d e = local_coordinates(now.inverse() * a.submap_from_camera);
      return e.head<3>().norm() + e.tail<3>().norm();
    };
    const double without = error({}), with = error({before, rolling.depth.readout / kInterval});
    std::printf("%.2f mm and mrad off, %.2f with it\n", 1000 * without, 1000 * with);
    EXPECT_LT(with, 0.5 * without);
  }
}

TEST(PhotometricReduce, EqualsItsPlainTwin) {
  // One level, one iteration, no geometry within reach: the information is from brightness alone.
  Room s;
  TrackOptions one = s.options;
  one.levels = 1;
  one.iterations_finest = 1;
  one.max_distance = 1e-4f;
  Aligner aligner(test_device(), one);
  PhotometricKeyframe keyframe(test_device(), s.camera, one);
  const Frame next = scene_frame(s.scene, s.camera, 1);
  const FramePyramid key = s.preprocessor.preprocess(s.frame);
  keyframe.set(key, *s.frame.world_from_camera, {});
  const auto key_points = download<shader::uvec2>(key.levels[0]->points, next.depth.size());
  const std::vector<double> brightness = twin::brightness(s.frame.color);
  const FramePyramid live = s.preprocessor.preprocess(next);
  const auto points = download<shader::uvec2>(live.levels[0]->points, next.depth.size());
  // Far from the model's view, so that no point has a correspondence.
  const Alignment a = aligner.align(live, s.raycaster.raycast(s.volume, *s.frame.world_from_camera),
                                    *next.world_from_camera, &keyframe);

  std::vector<float> live_depth(points.size()), key_depth(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    live_depth[i] = std::bit_cast<float>(points[i].x);
    key_depth[i] = std::bit_cast<float>(key_points[i].x);
  }
  const twin::Photometric expected =
      twin::photometric(twin::brightness(next.color), live_depth, brightness, key_depth, s.camera,
                        s.frame.world_from_camera->inverse() * *next.world_from_camera, 0.05);
  EXPECT_GT(expected.seen, 10000);
  EXPECT_NEAR(a.fit.photometric_rmse, expected.rmse, 0.01 * expected.rmse);
  EXPECT_NEAR(a.fit.photometric_share, expected.share, 0.005);
}

}  // namespace
}  // namespace cairn
