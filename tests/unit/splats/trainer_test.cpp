// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/trainer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "splats/initialize.hpp"
#include "splats/splat_renderer.hpp"
#include "support/device.hpp"

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
