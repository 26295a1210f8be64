// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/rasterizer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "support/device.hpp"
#include "support/splat_twin.hpp"

namespace cairn {
namespace {

constexpr int kDegree = 3;

Camera camera_of(int width, int height) {
  return {.width = width,
          .height = height,
          .fx = 0.9 * width,
          .fy = 0.9 * width,
          .cx = 0.5 * width - 0.5,
          .cy = 0.5 * height - 0.5};
}

SplatView view_of(int width, int height) {
  SplatView view{.camera = camera_of(width, height)};
  view.world_from_camera.linear() = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  view.world_from_camera.translation() = Eigen::Vector3d(0.3, -0.2, 0.1);
  return view;
}

/// Splats in and around the image, some behind the camera. `size_px`: mean standard deviation.
Splats random_splats(std::size_t count, const SplatView& view, float size_px, std::minstd_rand& random) {
  const auto uniform = [&](float from, float to) { return std::uniform_real_distribution<float>(from, to)(random); };
  const Camera& c = view.camera;
  Splats splats;
  splats.degree = kDegree;
  for (std::size_t i = 0; i < count; ++i) {
    const float z = i % 50 == 49 ? -1.0f : uniform(0.8f, 3.0f);
    const Eigen::Vector3d ray = c.ray(static_cast<double>(uniform(-0.1f, 1.1f)) * c.width,
                                      static_cast<double>(uniform(-0.1f, 1.1f)) * c.height);
    splats.positions.emplace_back((view.world_from_camera * (static_cast<double>(z) * ray)).cast<float>());
    const float mean = std::log(size_px * std::abs(z) / static_cast<float>(c.fx));
    const auto three = [&](float from, float to) -> Eigen::Vector3f {
      return {uniform(from, to), uniform(from, to), uniform(from, to)};
    };
    splats.log_scales.emplace_back(three(mean - 0.7f, mean + 0.7f));
    splats.rotations.emplace_back(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    splats.opacities.push_back(uniform(-2, 3));
    splats.colors.push_back(three(-1, 1));
    for (std::size_t k = 0; k < harmonics_per_splat(kDegree); ++k) splats.harmonics.push_back(three(-0.2f, 0.2f));
  }
  return splats;
}

TEST(SplatRasterizer, AgreesWithItsTwin) {
  constexpr double kTolerance = 1e-4;  // of colors in 0..1, and meters
  std::minstd_rand random(3);
  const SplatView view = view_of(150, 101);
  const Splats splats = random_splats(1000, view, 3, random);
  SplatRasterizer rasterizer(test_device());
  rasterizer.forward(upload(test_device(), splats), view);
  const SplatImage image = rasterizer.download_image();
  const std::vector<double> expected = twin::render_splats(twin::parameters_of(splats), kDegree, view);
  const std::size_t pixels = image.color.size();
  double worst = 0, covered = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      worst = std::max(worst,
                       std::abs(static_cast<double>(image.color[i][static_cast<int>(c)]) - expected[c * pixels + i]));
    worst = std::max(worst, std::abs(static_cast<double>(image.opacity[i]) - expected[3 * pixels + i]));
    worst = std::max(worst, std::abs(static_cast<double>(image.depth[i]) - expected[4 * pixels + i]));
    covered += expected[3 * pixels + i];
  }
  RecordProperty("worst", std::to_string(worst));
  EXPECT_LE(worst, kTolerance);
  EXPECT_GT(covered, 0.5 * static_cast<double>(pixels));
}

TEST(SplatRasterizer, RendersNothingWithoutVisibleSplats) {
  std::minstd_rand random(5);
  SplatView view = view_of(33, 18);
  Splats splats = random_splats(3, view, 2, random);
  view.world_from_camera.translation() -= 100 * view.world_from_camera.linear().col(0);
  SplatRasterizer rasterizer(test_device());
  rasterizer.forward(upload(test_device(), splats), view);
  for (const float opacity : rasterizer.download_image().opacity) EXPECT_EQ(opacity, 0);
}

/// Parameters whose gradients share a unit.
struct Group {
  const char* name;
  std::size_t first, count;
};
constexpr std::array kGroups{Group{"position", 0, 3}, Group{"scale", 3, 3},  Group{"rotation", 6, 4},
                             Group{"opacity", 10, 1}, Group{"color", 11, 3}, Group{"harmonics", 14, 45}};

TEST(SplatRasterizer, GradientsAgreeWithFiniteDifferences) {
  constexpr double kTolerance = 1e-3;  // relative to the gradient of a group of parameters
  constexpr double kStep = 1e-6;
  constexpr std::size_t kScenes = 125, kSplats = 8;  // 1,000 splats
  constexpr int kWidth = 22, kHeight = 15;
  const SplatView view = view_of(kWidth, kHeight);
  const std::size_t pixels = std::size_t{kWidth} * kHeight;
  std::minstd_rand random(11);
  gpu::Device& device = test_device();
  SplatRasterizer rasterizer(device);
  std::array<double, kGroups.size()> worst{};
  std::array<std::size_t, kGroups.size()> compared{};
  for (std::size_t scene = 0; scene < kScenes; ++scene) {
    const Splats splats = random_splats(kSplats, view, 2, random);
    std::vector<float> weights(5 * pixels);
    for (float& w : weights) w = std::uniform_real_distribution<float>(-1, 1)(random);
    const auto objective = [&](const std::vector<twin::SplatParameters>& parameters) {
      const std::vector<double> image = twin::render_splats(parameters, kDegree, view);
      double sum = 0;
      for (std::size_t i = 0; i < image.size(); ++i) sum += static_cast<double>(weights[i]) * image[i];
      return sum;
    };
    const SplatModel model = upload(device, splats);
    const gpu::Buffer of_pixels(device, 4 * weights.size());
    std::vector<float> core(shader::kSplatPlanes * kSplats), harmonics(45 * kSplats);
    std::vector<std::uint32_t> ranks(kSplats);
    gpu::Batch batch(device);
    batch.upload(of_pixels, weights);
    batch.run();
    rasterizer.forward(model, view);
    rasterizer.backward(model, of_pixels);
    batch.download(rasterizer.gradients(), core);
    batch.download(rasterizer.harmonic_gradients(), harmonics);
    batch.download(rasterizer.ranks(), ranks);
    batch.run();
    std::vector<twin::SplatParameters> parameters = twin::parameters_of(splats);
    for (std::size_t i = 0; i < kSplats; ++i)
      for (std::size_t g = 0; g < kGroups.size() && ranks[i] != shader::kNoSplatRank; ++g) {
        double error = 0, size = 0;
        for (std::size_t k = kGroups[g].first; k < kGroups[g].first + kGroups[g].count; ++k) {
          double& parameter = parameters[i][k];
          const double value = parameter;
          parameter = value + kStep;
          const double above = objective(parameters);
          parameter = value - kStep;
          const double below = objective(parameters);
          parameter = value;
          const double numeric = (above - below) / (2 * kStep);
          const auto analytic = static_cast<double>(k < 14 ? core[k * kSplats + i] : harmonics[(k - 14) * kSplats + i]);
          error += (analytic - numeric) * (analytic - numeric);
          size += numeric * numeric;
        }
        if (size < 1e-6) continue;  // without an effect, or of terms that cancel out in single precision
        ++compared[g];
        worst[g] = std::max(worst[g], std::sqrt(error / size));
      }
  }
  for (std::size_t g = 0; g < kGroups.size(); ++g) {
    RecordProperty(kGroups[g].name, std::to_string(worst[g]));
    EXPECT_LE(worst[g], kTolerance) << kGroups[g].name;
    EXPECT_GT(compared[g], 0.6 * kScenes * kSplats) << kGroups[g].name;
  }
}

TEST(SplatRasterizer, GradientsHaveTheSameBytesTwice) {
  std::minstd_rand random(17);
  const SplatView view = view_of(120, 90);
  gpu::Device& device = test_device();
  const SplatModel model = upload(device, random_splats(2000, view, 3, random));
  const std::vector<float> weights(std::size_t{5} * 120 * 90, 0.25f);
  const gpu::Buffer of_pixels(device, 4 * weights.size());
  const auto gradients = [&] {
    SplatRasterizer rasterizer(device);
    gpu::Batch batch(device);
    batch.upload(of_pixels, weights);
    batch.run();
    rasterizer.forward(model, view);
    rasterizer.backward(model, of_pixels);
    std::vector<float> planes(std::size_t{shader::kSplatPlanes} * model.count);
    std::vector<std::uint32_t> ranks(model.count);
    batch.download(rasterizer.gradients(), planes);
    batch.download(rasterizer.ranks(), ranks);
    batch.run();
    std::vector<float> visible;
    for (std::size_t k = 0; k < planes.size(); ++k)
      if (ranks[k % model.count] != shader::kNoSplatRank) visible.push_back(planes[k]);
    return visible;
  };
  const std::vector<float> first = gradients();
  EXPECT_GT(first.size(), std::size_t{shader::kSplatPlanes} * 1000);
  EXPECT_EQ(first, gradients());
}

}  // namespace
}  // namespace cairn
