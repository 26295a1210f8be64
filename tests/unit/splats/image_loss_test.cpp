// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/image_loss.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "support/device.hpp"
#include "support/splat_twin.hpp"

namespace cairn {
namespace {

constexpr int kWidth = 21, kHeight = 17;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;

struct LossScene {
  std::vector<float> image = std::vector<float>(5 * kPixels), depth = std::vector<float>(kPixels);
  std::vector<std::uint32_t> color = std::vector<std::uint32_t>(kPixels);
  Exposure exposure{.gain = {1.1f, 0.9f, 1.05f}, .offset = {0.02f, -0.01f, 0.03f}};
  LossWeights weights{.structure = 0.2f, .depth = 0.3f, .opacity = 0.1f};

  LossScene() {
    std::minstd_rand random(23);
    const auto uniform = [&](float from, float to) { return std::uniform_real_distribution<float>(from, to)(random); };
    for (float& value : image) value = uniform(0, 1);
    for (std::uint32_t& word : color) word = 0xff000000u | static_cast<std::uint32_t>(random()) % 0xffffffu;
    for (float& z : depth) z = uniform(0, 1) < 0.3f ? 0.0f : uniform(0.5f, 3);
  }
  [[nodiscard]] double loss(const std::vector<double>& changed, const Exposure& changed_exposure) const {
    return twin::splat_loss(changed, kWidth, kHeight, color, depth, changed_exposure, weights);
  }
};

TEST(ImageLoss, AndItsGradientsAgreeWithTheTwin) {
  constexpr double kTolerance = 1e-3, kStep = 1e-6, kExposureStep = 1e-3;
  const LossScene scene;
  gpu::Device& device = test_device();
  const gpu::Buffer image(device, 4 * scene.image.size()), color(device, 4 * kPixels), depth(device, 4 * kPixels);
  gpu::Batch batch(device);
  batch.upload(image, scene.image);
  batch.upload(color, scene.color);
  batch.upload(depth, scene.depth);
  batch.run();
  ImageLoss loss(device);
  loss.compare(kWidth, kHeight, image, color, depth, scene.exposure, scene.weights);
  std::vector<float> gradients(5 * kPixels);
  batch.download(loss.gradients(), gradients);
  batch.run();
  const ImageError error = loss.error();
  std::vector<double> values(scene.image.begin(), scene.image.end());
  EXPECT_NEAR(error.loss, scene.loss(values, scene.exposure), 1e-5);
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double value = values[i];
    values[i] = value + kStep;
    const double above = scene.loss(values, scene.exposure);
    values[i] = value - kStep;
    const double below = scene.loss(values, scene.exposure);
    values[i] = value;
    const double numeric = (above - below) / (2 * kStep);
    worst = std::max(worst, std::abs(static_cast<double>(gradients[i]) - numeric));
    largest = std::max(largest, std::abs(numeric));
  }
  EXPECT_LE(worst, kTolerance * largest);
  for (int c = 0; c < 3; ++c)
    for (const bool is_gain : {true, false}) {
      Exposure above = scene.exposure, below = scene.exposure;
      (is_gain ? above.gain : above.offset)[c] += static_cast<float>(kExposureStep);
      (is_gain ? below.gain : below.offset)[c] -= static_cast<float>(kExposureStep);
      const double numeric = (scene.loss(values, above) - scene.loss(values, below)) / (2 * kExposureStep);
      const auto analytic = static_cast<double>((is_gain ? error.gradient.gain : error.gradient.offset)[c]);
      EXPECT_NEAR(analytic, numeric, 0.02 * std::abs(numeric) + 1e-4);  // L1 has kinks within the step
    }
}

}  // namespace
}  // namespace cairn
