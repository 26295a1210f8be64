// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/trainer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "splats/exposure.hpp"
#include "splats/initialize.hpp"
#include "splats/splat_renderer.hpp"
#include "splats/training_memory.hpp"
#include "support/device.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

const Camera kCamera{.width = 80, .height = 60, .fx = 70, .fy = 70, .cx = 39.5, .cy = 29.5};
constexpr float kWall = 2;  // meters from the cameras

/// Color of the wall z = kWall, 0..1.
Eigen::Vector3f wall(float x, float y) {
  return {0.5f + 0.4f * std::sin(5 * x), 0.5f + 0.4f * std::sin(6 * y + 1), x * y > 0 ? 0.8f : 0.3f};
}

/// View from (x, 0, 0) along z. `gain`: exposure; `hole`: columns without a surface in the map.
TrainingView view_from(double x, float gain = 1, int hole = 0) {
  TrainingView view{.camera = kCamera, .color = {}, .depth = {}};
  view.world_from_camera.translation().x() = x;
  for (int v = 0; v < kCamera.height; ++v)
    for (int u = 0; u < kCamera.width; ++u) {
      const Eigen::Vector3f p =
          (view.world_from_camera * (static_cast<double>(kWall) * kCamera.ray(u, v))).cast<float>();
      const Eigen::Vector3f color = 255 * gain * wall(p.x(), p.y());
      std::uint32_t word = 0xff000000u;
      for (int c = 0; c < 3; ++c)
        word |= static_cast<std::uint32_t>(std::lround(std::clamp(color[c], 0.0f, 255.0f))) << (8 * c);
      view.color.push_back(word);
      view.depth.push_back(u < hole ? 0 : kWall);
    }
  return view;
}

std::vector<TrainingView> views() {
  std::vector<TrainingView> views;
  for (const double x : {-0.3, -0.2, -0.1, 0.1, 0.2, 0.3}) views.push_back(view_from(x));
  return views;
}

/// The wall, without colors.
Mesh wall_mesh() {
  Mesh mesh;
  for (const auto& [x, y] : {std::pair{-2.0f, -1.5f}, {2.0f, -1.5f}, {2.0f, 1.5f}, {-2.0f, 1.5f}}) {
    mesh.positions.emplace_back(x, y, kWall);
    mesh.normals.emplace_back(0, 0, -1);
  }
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  return mesh;
}

/// The wall as a grid of triangles.
Mesh fine_wall_mesh() {
  constexpr int kColumns = 40, kRows = 30;
  Mesh mesh;
  for (int row = 0; row <= kRows; ++row)
    for (int column = 0; column <= kColumns; ++column) {
      mesh.positions.emplace_back(4.0f * static_cast<float>(column) / kColumns - 2,
                                  3.0f * static_cast<float>(row) / kRows - 1.5f, kWall);
      mesh.normals.emplace_back(0, 0, -1);
    }
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      const auto a = static_cast<std::uint32_t>(row * (kColumns + 1) + column), b = a + kColumns + 1;
      mesh.triangles.push_back({a, b, a + 1});
      mesh.triangles.push_back({a + 1, b, b + 1});
    }
  return mesh;
}

double psnr(const Splats& splats, const TrainingView& view) {
  SplatRenderer renderer(test_device(), splats);
  const RenderedView rendered = renderer(view.camera, view.world_from_camera);
  double squared = 0;
  for (std::size_t i = 0; i < view.color.size(); ++i)
    for (int c = 0; c < 24; c += 8) {
      const double off =
          static_cast<double>(rendered.color[i] >> c & 255) - static_cast<double>(view.color[i] >> c & 255);
      squared += off * off / static_cast<double>(3 * view.color.size());
    }
  return 10 * std::log10(255 * 255 / squared);
}

Splats trained(int steps) {
  const std::vector<TrainingView> from = views();
  SplatTrainer trainer(test_device(), surfels_of(wall_mesh(), from, 3000, 1), from,
                       {.iterations = steps, .max_splats = 4000, .densify_interval = 20});
  for (int i = 0; i < steps; ++i) (void)trainer.step();
  return trainer.splats();
}

TEST(SplatInitialization, PutsSurfelsOnTheSurfaceInTheColorsOfTheImages) {
  const Splats splats = surfels_of(wall_mesh(), views(), 2000, 0);
  ASSERT_EQ(splats.size(), 2000);
  std::size_t seen = 0;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const Eigen::Vector3f& p = splats.positions[i];
    EXPECT_NEAR(p.z(), kWall, 1e-5f);
    EXPECT_LT(splats.log_scales[i].z(), splats.log_scales[i].x());  // flat along the normal
    if (std::abs(p.x()) > 0.7f || std::abs(p.y()) > 0.7f || std::abs(p.x() * p.y()) < 0.05f) continue;
    ++seen;
    EXPECT_LT((Eigen::Vector3f(0.5f + 0.28209479f * splats.colors[i].array()) - wall(p.x(), p.y())).norm(), 0.05f);
  }
  EXPECT_GT(seen, 100);
}

TEST(SplatInitialization, FillsImagesWithoutSurface) {
  const TrainingView with_hole = view_from(0, 1, 40);
  EXPECT_TRUE(has_background(with_hole));
  EXPECT_FALSE(has_background(view_from(0)));
  const std::size_t pixels = with_hole.color.size();
  SplatImage image{.color = {}, .opacity = std::vector<float>(pixels, 1.0f), .depth = {}};
  for (std::size_t i = 0; i < pixels; ++i) image.opacity[i] = i % 80 < 40 ? 0.0f : 1.0f;
  Splats splats;
  append_background(splats, with_hole, image);
  EXPECT_EQ(splats.size(), 40 * 60 / 16);
  for (const Eigen::Vector3f& p : splats.positions) EXPECT_LT(p.x(), 0);
}

TEST(TrainingView, HalvedHasTheMeanColorsAtTheSamePlaces) {
  TrainingView view{
      .camera = {.width = 4, .height = 2, .fx = 5, .fy = 6, .cx = 1.2, .cy = 0.7}, .color = {}, .depth = {}};
  view.color = {0xff000010u, 0xff000020u, 0xff0000ffu, 0xff0000ffu, 0xff000030u, 0xff000041u, 0xff00ff00u, 0xffff0000u};
  view.depth = {1, 0, 0, 0, 2, 0, 0, 0};
  const TrainingView half = halved(view);
  EXPECT_EQ(half.color, (std::vector<std::uint32_t>{0xff000028u, 0xff404080u}));
  EXPECT_EQ(half.depth, (std::vector<float>{1.5f, 0}));
  const Eigen::Vector3d point(0.3, -0.1, 2);
  const Eigen::Vector2d whole = view.camera.project(point), found = half.camera.project(point);
  EXPECT_LT((2 * found + Eigen::Vector2d::Constant(0.5) - whole).norm(), 1e-9);
}

TEST(SplatExposure, FindsTheGainsOfTheImages) {
  constexpr std::array kGains = {0.7f, 1.0f, 1.2f, 0.9f, 1.1f};
  std::vector<TrainingView> from;
  for (std::size_t k = 0; k < kGains.size(); ++k)
    from.push_back(view_from(0.1 * static_cast<double>(k) - 0.2, kGains[k]));
  estimate_gains(from, fine_wall_mesh());
  Eigen::Array3f product = Eigen::Array3f::Ones();
  for (std::size_t k = 0; k < kGains.size(); ++k) {
    product *= from[k].gain.array();
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(from[k].gain[c] / from[1].gain[c], kGains[k], 0.02f);
  }
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(product[c], 1, 1e-3f);
}

TEST(TrainingMemory, GrowsWithImagesAndSplatsAndNamesTheRemedy) {
  const TrainingMemory small = training_memory(100, kCamera, 1000, 1), large = training_memory(1000, kCamera, 2000, 3);
  EXPECT_EQ(large.images, 10 * small.images);
  EXPECT_GT(large.splats, 2 * small.splats);
  expect_enough(small, small.total());
  expect_enough(small, 0);  // unknown
  EXPECT_NE(error_of([&] { expect_enough(small, small.total() - 1); }).find("use fewer SplatOptions::"),
            std::string::npos);
}

TEST(SplatTrainer, ImprovesImagesOutsideOfItsTraining) {
  const TrainingView held_out = view_from(0.0);
  const double before = psnr(surfels_of(wall_mesh(), views(), 3000, 1), held_out), after = psnr(trained(150), held_out);
  EXPECT_GT(after, before + 6);
  EXPECT_GT(after, 30);
}

TEST(SplatTrainer, MakesTheSameSplatsTwice) {
  const Splats first = trained(50), second = trained(50);  // with a densification
  EXPECT_EQ(first.positions, second.positions);
  EXPECT_EQ(first.harmonics, second.harmonics);
  EXPECT_EQ(first.opacities, second.opacities);
  EXPECT_NE(first.size(), 3000);
}

TEST(SplatTrainer, AdaptsToTheExposureOfAnImage) {
  std::vector<TrainingView> from = views();
  from.push_back(view_from(0.05, 0.7f));
  from.push_back(view_from(-0.05, 1.3f));
  SplatTrainer trainer(test_device(), surfels_of(wall_mesh(), from, 3000, 0), from,
                       {.iterations = 320, .max_splats = 3000});
  for (int i = 0; i < 280; ++i) (void)trainer.step();
  double squared = 0;
  for (int i = 0; i < 40; ++i) squared += trainer.step().squared / 40;
  EXPECT_GT(-10 * std::log10(squared), 27);  // a single exposure: below 20 dB in two of eight images
}

}  // namespace
}  // namespace cairn
