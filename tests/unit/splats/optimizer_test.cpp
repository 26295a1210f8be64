// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/optimizer.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/device.hpp"

namespace cairn {
namespace {

/// Two splats in front of the camera and one behind it.
Splats three_splats() {
  Splats splats;
  for (const float z : {1.0f, -1.0f, 1.5f}) {
    splats.positions.emplace_back(0.1f * z, 0, z);
    splats.log_scales.emplace_back(Eigen::Vector3f::Constant(std::log(0.1f)));
    splats.rotations.emplace_back(1, 0, 0, 0);
    splats.opacities.push_back(0);
    splats.colors.emplace_back(Eigen::Vector3f::Zero());
  }
  return splats;
}

const SplatView kView{.camera = {.width = 32, .height = 24, .fx = 30, .fy = 30, .cx = 15.5, .cy = 11.5}};

void backward(SplatRasterizer& rasterizer, const SplatModel& model) {
  const std::vector<float> weights(std::size_t{5} * 32 * 24, 1.0f);
  const gpu::Buffer pixels(test_device(), 4 * weights.size());
  gpu::Batch batch(test_device());
  batch.upload(pixels, weights);
  batch.run();
  rasterizer.forward(model, kView);
  rasterizer.backward(model, pixels);
  test_device().wait();
}

TEST(SplatOptimizer, FirstStepHasTheLengthOfTheRate) {
  const Splats before = three_splats();
  SplatOptimizer optimizer(test_device(), upload(test_device(), before));
  SplatRasterizer rasterizer(test_device());
  backward(rasterizer, optimizer.model());
  optimizer.step(rasterizer, {.opacity = 0.25f, .color = 0.125f});
  const Splats after = download(test_device(), optimizer.model());
  for (const std::size_t visible : {0u, 2u}) {  // all weights are positive: less opacity, darker
    EXPECT_NEAR(after.opacities[visible], before.opacities[visible] - 0.25f, 1e-5f);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(after.colors[visible][c], before.colors[visible][c] - 0.125f, 1e-5f);
  }
  EXPECT_EQ(after.opacities[1], before.opacities[1]);
  EXPECT_EQ(after.positions[1], before.positions[1]);
}

TEST(SplatOptimizer, ReplacedSplatsKeepTheirMoments) {
  SplatOptimizer optimizer(test_device(), upload(test_device(), three_splats()));
  SplatRasterizer rasterizer(test_device());
  backward(rasterizer, optimizer.model());
  optimizer.step(rasterizer, {});
  const Splats after = download(test_device(), optimizer.model());
  Splats reversed;
  for (const std::size_t i : {2u, 1u, 0u}) {
    reversed.positions.push_back(after.positions[i]);
    reversed.log_scales.push_back(after.log_scales[i]);
    reversed.rotations.push_back(after.rotations[i]);
    reversed.opacities.push_back(after.opacities[i]);
    reversed.colors.push_back(after.colors[i]);
  }
  const auto second_step = [&](SplatOptimizer& o) {
    backward(rasterizer, o.model());
    o.step(rasterizer, {});
    return download(test_device(), o.model());
  };
  SplatOptimizer replaced(test_device(), upload(test_device(), three_splats()));
  backward(rasterizer, replaced.model());
  replaced.step(rasterizer, {});
  replaced.replace(reversed, {2, 1, 0});
  const Splats expected = second_step(optimizer), found = second_step(replaced);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(found.opacities[i], expected.opacities[2 - i]);
    EXPECT_EQ(found.positions[i], expected.positions[2 - i]);
  }
}

}  // namespace
}  // namespace cairn
