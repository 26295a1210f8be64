// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/depth_correction.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>

#include "cairn/mapping/rig.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

const DepthCorrection kTilted{2, 2, {-0.01f, 0.01f, -0.01f, 0.01f}};

TEST(DepthCorrection, AddsOffsetToInverseDepth) {
  std::vector<float> depth(8 * 4, 2.0f);
  depth[3] = 0;
  kTilted.apply(8, 4, depth);
  EXPECT_FLOAT_EQ(depth[0], 1 / (0.5f - 0.01f));
  EXPECT_FLOAT_EQ(depth[7], 1 / (0.5f + 0.01f));
  EXPECT_EQ(depth[3], 0.0f);
  for (const int x : {0, 1, 2, 4, 5, 6, 7}) {
    const float offset = kTilted.at((static_cast<float>(x) + 0.5f) / 8, 0.5f);
    EXPECT_FLOAT_EQ(depth[static_cast<std::size_t>(x)], 1 / (0.5f + offset));
  }
}

TEST(DepthCorrection, IsLinearBetweenNodesAndConstantBeyondThem) {
  EXPECT_FLOAT_EQ(kTilted.at(0, 0), -0.01f);
  EXPECT_FLOAT_EQ(kTilted.at(0.25f, 1), -0.01f);
  EXPECT_NEAR(kTilted.at(0.5f, 0.5f), 0, 1e-8);
  EXPECT_NEAR(kTilted.at(0.625f, 0.5f), 0.005f, 1e-8);
  EXPECT_FLOAT_EQ(kTilted.at(1, 0), 0.01f);
}

TEST(DepthCorrection, CorrectsEachPixelByPosition) {
  DepthCorrection uneven{4, 5, {}};
  for (int i = 0; i < 20; ++i) uneven.offsets.push_back(0.001f * static_cast<float>(i * i % 17));
  constexpr int kWidth = 23, kHeight = 70;
  std::vector<float> depth(kWidth * kHeight, 2.0f);
  uneven.apply(kWidth, kHeight, depth);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const float offset = uneven.at((static_cast<float>(x) + 0.5f) / kWidth, (static_cast<float>(y) + 0.5f) / kHeight);
      EXPECT_NEAR(depth[static_cast<std::size_t>(y * kWidth + x)], 1 / (0.5f + offset), 1e-6) << x << ' ' << y;
    }
}

TEST(DepthCorrection, ComposesCorrections) {
  std::vector<float> twice(8 * 4, 3.0f), once = twice;
  kTilted.apply(8, 4, twice), kTilted.apply(8, 4, twice);
  kTilted.compose(kTilted).apply(8, 4, once);
  for (std::size_t i = 0; i < once.size(); ++i) EXPECT_NEAR(once[i], twice[i], 1e-5);
  EXPECT_EQ(DepthCorrection{}.compose(kTilted), kTilted);
  EXPECT_EQ(kTilted.compose({}), kTilted);
}

TEST(DepthCorrection, RejectsInvalidGrid) {
  EXPECT_NO_THROW(check(DepthCorrection{}));
  EXPECT_NO_THROW(check(kTilted));
  EXPECT_THROW(check(DepthCorrection{2, 2, {0, 0, 0}}), std::runtime_error);
  EXPECT_THROW(check(DepthCorrection{1, 4, {0, 0, 0, 0}}), std::runtime_error);
  EXPECT_THROW(check(DepthCorrection{2, 2, {0, 0, 0, 2}}), std::runtime_error);
  EXPECT_THROW(check(DepthCorrection{2, 2, {0, 0, 0, std::numeric_limits<float>::quiet_NaN()}}), std::runtime_error);
}

TEST(DepthCorrection, IsStoredInCameraYaml) {
  const TemporaryFolder folder;
  Rig rig = Camera{640, 480, 525, 525, 319.5, 239.5, {}};
  rig.depth_correction = {3, 2, {0.001f, -0.0025f, 0, 1e-7f, 0.125f, -0.5f}};
  write_rig(folder / "camera.yaml", rig);
  EXPECT_EQ(read_rig(folder / "camera.yaml"), rig);
  write_text(folder / "bad.yaml",
             "fx: 525\nfy: 525\ncx: 320\ncy: 240\ndepth_correction:\n  columns: 3\n  rows: 2\n  offsets: [0, 1]\n");
  try {
    (void)read_rig(folder / "bad.yaml");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()),
              (folder / "bad.yaml").string() + ": depth_correction has 2 offsets, 3 columns and 2 rows need 6");
  }
}

}  // namespace
}  // namespace cairn
