// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "preprocess/preprocess.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <random>

#include "support/scenes.hpp"
#include "support/twins.hpp"

namespace cairn {
namespace {

constexpr float kTolerance = 2e-5f;  // meters: sums of 25 products in 32 bits

class PreprocessOfSize : public testing::TestWithParam<std::pair<int, int>> {};

TEST_P(PreprocessOfSize, EqualsItsPlainTwin) {
  Camera camera = small_camera();
  camera.width = GetParam().first, camera.height = GetParam().second;
  const SurfaceOptions options;
  Preprocessor preprocessor(test_device(), camera, options, 2, 0);
  const Frame frame = scene_frame(synthetic_scene("room"), camera, 10, true);
  const FramePyramid surface = preprocessor.preprocess(frame);

  const auto expected = twin::filter(frame.depth, camera, options);
  const auto fusion = download<shader::uvec2>(*surface.fusion, frame.depth.size());
  const auto points = download<shader::uvec2>(surface.levels[0]->points, frame.depth.size());
  const auto normals = twin::normals(expected.smooth, camera);
  int with_normal = 0, different = 0;
  for (std::size_t i = 0; i < frame.depth.size(); ++i) {
    ASSERT_EQ(std::bit_cast<float>(fusion[i].x), expected.clean[i]) << i;
    ASSERT_EQ(fusion[i].y, frame.color[i]) << i;
    ASSERT_NEAR(std::bit_cast<float>(points[i].x), expected.smooth[i], kTolerance) << i;
    const bool has = points[i].y != 0, should = !normals[i].isZero();
    different += has != should;  // rounding of a difference at the limit
    if (!has || !should) continue;
    ++with_normal;
    ASSERT_GT(twin::unpack_normal(points[i].y).dot(normals[i]), 0.995f) << i;
  }
  EXPECT_GT(with_normal, camera.width * camera.height / 4);
  EXPECT_LT(different, 50);

  const auto coarse = twin::half(expected.smooth, camera);
  const auto coarse_points = download<shader::uvec2>(surface.levels[1]->points, coarse.size());
  for (std::size_t i = 0; i < coarse.size(); ++i)
    ASSERT_NEAR(std::bit_cast<float>(coarse_points[i].x), coarse[i], 2e-3f) << i;
}

INSTANTIATE_TEST_SUITE_P(, PreprocessOfSize,
                         testing::Values(std::pair(320, 240), std::pair(321, 241), std::pair(322, 239),
                                         std::pair(323, 240), std::pair(17, 16)),
                         [](const auto& test) {
                           return std::to_string(test.param.first) + "x" + std::to_string(test.param.second);
                         });

TEST(Preprocess, RemovesAFlyingPixelAndKeepsTheEdge) {
  const Camera camera = small_camera();
  Frame frame{.depth = std::vector<float>(static_cast<std::size_t>(camera.width * camera.height), 1.0f)};
  const auto at = [&](int x) -> float& { return frame.depth[static_cast<std::size_t>(100 * camera.width + x)]; };
  for (int y = 0; y < camera.height; ++y)
    for (int x = 161; x < camera.width; ++x) frame.depth[static_cast<std::size_t>(y * camera.width + x)] = 2.0f;
  at(160) = 1.5f;
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  const FramePyramid surface = preprocessor.preprocess(frame);
  const auto fusion = download<shader::uvec2>(*surface.fusion, frame.depth.size());
  const auto clean = [&](int x) {
    return std::bit_cast<float>(fusion[static_cast<std::size_t>(100 * camera.width + x)].x);
  };
  EXPECT_EQ(clean(160), 0.0f);
  EXPECT_EQ(clean(159), 1.0f);
  EXPECT_EQ(clean(161), 2.0f);
}

TEST(Preprocess, KeepsThePositionOfANoisyPlane) {
  // Sensor noise is symmetric in disparity or in depth; a mean that excludes more values of one side would shift the
  // map.
  const Camera camera = small_camera();
  constexpr float kDepth = 3;
  const float sigma = SensorModel{}.sigma(kDepth) / (kDepth * kDepth);  // 1 / m
  Preprocessor preprocessor(test_device(), camera, {}, 3, 0);
  for (const float times : {1.0f, 2.0f, 3.0f}) {
    std::mt19937 random(1);
    std::normal_distribution<float> noise(0, times * sigma);
    Frame frame{.depth = std::vector<float>(static_cast<std::size_t>(camera.width * camera.height))};
    for (float& z : frame.depth) z = 1 / (1 / kDepth + noise(random));
    const FramePyramid surface = preprocessor.preprocess(frame);
    for (int level = 0; level < 3; ++level) {
      const Camera& c = surface.levels[static_cast<std::size_t>(level)]->camera;
      const auto points = download<shader::uvec2>(surface.levels[static_cast<std::size_t>(level)]->points,
                                                  static_cast<std::size_t>(c.width * c.height));
      double sum = 0, count = 0;
      for (const auto& p : points)
        if (const float z = std::bit_cast<float>(p.x); z > 0) sum += 1 / z, ++count;
      EXPECT_GT(count, 0.8 * static_cast<double>(points.size()));
      EXPECT_NEAR(count / sum, kDepth, 0.0002 * kDepth) << times << " times the noise, level " << level;
    }
  }
}

TEST(Preprocess, RemovesDistortion) {
  // A plane has constant depth, so color identifies pixels: a pattern of the pixel coordinates.
  Camera camera = small_camera();
  camera.distortion = {0.2624, -0.9531, -0.0054, 0.0026, 1.1633};
  Frame frame{.depth = std::vector<float>(static_cast<std::size_t>(camera.width * camera.height), 1.0f)};
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      frame.color.push_back(0xff000000u | static_cast<std::uint32_t>(x / 2) | static_cast<std::uint32_t>(y) << 8);
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  const FramePyramid surface = preprocessor.preprocess(frame);
  const auto fusion = download<shader::uvec2>(*surface.fusion, frame.depth.size());
  const auto& [k1, k2, p1, p2, k3, k4, k5, k6] = camera.distortion;
  for (const auto& [x, y] : {std::pair{160, 120}, {60, 60}, {250, 180}, {40, 200}}) {
    const double u = (x - camera.cx) / camera.fx, v = (y - camera.cy) / camera.fy, r2 = u * u + v * v;
    const double radial = 1 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
    const double du = u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u),
                 dv = v * radial + p1 * (r2 + 2 * v * v) + 2 * p2 * u * v;
    const std::uint32_t c = fusion[static_cast<std::size_t>(y * camera.width + x)].y;
    EXPECT_NEAR(c & 0xff, (camera.fx * du + camera.cx) / 2, 1.0);
    EXPECT_NEAR((c >> 8) & 0xff, camera.fy * dv + camera.cy, 1.0);
  }
}

/// Color image that encodes its pixel coordinates: eighths of the column and the row.
std::vector<std::uint32_t> pixel_colors(const Camera& camera) {
  std::vector<std::uint32_t> colors;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      colors.push_back(0xff000000u | static_cast<std::uint32_t>(x / 8 + 10) |
                       static_cast<std::uint32_t>(y / 8 + 10) << 8);
  return colors;
}

struct BesideColor {
  explicit BesideColor(const Camera& color) {
    rig.color.emplace().camera = color;
    rig.color->color_from_depth =
        Eigen::Translation3d(-0.1, 0.02, 0.01) * Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY());
  }
  /// Color registered to depth, by pixel.
  [[nodiscard]] std::vector<shader::uvec2> fusion(const std::vector<float>& depth) {
    Frame frame{.depth = depth, .color = pixel_colors(rig.color->camera)};
    Preprocessor preprocessor(test_device(), rig, {}, 1, 0);
    return download<shader::uvec2>(*preprocessor.preprocess(frame).fusion, depth.size());
  }
  Rig rig = small_camera();
};

TEST(Preprocess, RegistersTheColorOfASeparateCamera) {
  Camera brown{.width = 1280, .height = 720, .fx = 900, .fy = 910, .cx = 640, .cy = 350};
  brown.distortion = {0.08, -0.05, 0.001, -0.002, 0.01, 0.02, -0.01, 0.005};
  Camera fisheye = brown;
  fisheye.lens = Lens::fisheye;
  fisheye.distortion = {0.02, -0.01, 0.003, -0.001};
  const Camera small{.width = 200, .height = 150, .fx = 150, .fy = 150, .cx = 100, .cy = 75};
  for (const Camera& color : {brown, fisheye, small}) {
    BesideColor beside(color);
    const Camera& depth = beside.rig.depth;
    const auto fusion = beside.fusion(std::vector<float>(static_cast<std::size_t>(depth.width * depth.height), 1.5f));
    int seen = 0;
    for (int y = 4; y < depth.height; y += 7)
      for (int x = 4; x < depth.width; x += 7) {
        const Eigen::Vector3d p = beside.rig.color->color_from_depth * (1.5 * depth.ray(x, y));
        const Eigen::Vector2d bent = color.distort(p.head<2>() / p.z());
        const double u = color.fx * bent.x() + color.cx, v = color.fy * bent.y() + color.cy;
        const std::uint32_t c = fusion[static_cast<std::size_t>(y * depth.width + x)].y;
        if (u < 3 || v < 3 || u > color.width - 4 || v > color.height - 4) {
          const bool is_outside = u < -1 || v < -1 || u > color.width || v > color.height;
          EXPECT_TRUE(c == 0 || !is_outside) << x << " " << y;
          continue;
        }
        ++seen;
        EXPECT_NEAR(c & 0xff, u / 8 + 9.5, 0.75) << x << " " << y;
        EXPECT_NEAR((c >> 8) & 0xff, v / 8 + 9.5, 0.75) << x << " " << y;
      }
    EXPECT_GT(seen, 500);
  }
}

TEST(Preprocess, LeavesOccludedPixelsWithoutColor) {
  BesideColor beside({.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 320, .cy = 240});
  beside.rig.color->color_from_depth = Eigen::Translation3d(-0.1, 0, 0);  // right of the depth camera
  const Camera& depth = beside.rig.depth;
  constexpr int kLeft = 140, kRight = 180;  // columns of a post
  std::vector<float> z(static_cast<std::size_t>(depth.width * depth.height), 2.0f);
  for (int y = 0; y < depth.height; ++y)
    for (int x = kLeft; x < kRight; ++x) z[static_cast<std::size_t>(y * depth.width + x)] = 1.0f;
  const auto fusion = beside.fusion(z);
  const auto has_color = [&](int x) { return fusion[static_cast<std::size_t>(120 * depth.width + x)].y != 0; };
  // The post occludes as much of the wall on its left as its disparity exceeds the wall's.
  const int shadow = static_cast<int>(0.1 * depth.fx * (1 / 1.0 - 1 / 2.0));
  for (int x = kLeft - shadow + 2; x < kLeft - 2; ++x) EXPECT_FALSE(has_color(x)) << x;
  for (const int x : {kLeft - shadow - 5, kLeft + 5, kRight - 5, kRight + 5, kRight + 20})
    EXPECT_TRUE(has_color(x)) << x;
}

TEST(Preprocess, AcceptsImagesOfAnySize) {
  for (const auto& [width, height] : {std::pair(37, 23), {38, 24}, {39, 23}, {41, 22}}) {
    const Camera camera{.width = width, .height = height, .fx = 30, .fy = 30, .cx = 0.5 * width, .cy = 0.5 * height};
    Frame frame;
    for (int i = 0; i < width * height; ++i) {
      frame.depth.push_back(1.5f);
      frame.color.push_back(0xff000000u | static_cast<std::uint32_t>(i));
    }
    for (const int finest : {0, 1}) {
      Preprocessor preprocessor(test_device(), camera, {}, 3, finest);
      const FramePyramid surface = preprocessor.preprocess(frame);
      const auto fusion = download<shader::uvec2>(*surface.fusion, frame.depth.size());
      for (std::size_t i = 0; i < fusion.size(); ++i) {
        ASSERT_EQ(std::bit_cast<float>(fusion[i].x), 1.5f) << width << " x " << height << ", " << i;
        ASSERT_EQ(fusion[i].y, frame.color[i]) << width << " x " << height << ", " << i;
      }
      for (std::size_t level = static_cast<std::size_t>(finest); level < 3; ++level) {
        const Camera& c = surface.levels[level]->camera;
        const auto points =
            download<shader::uvec2>(surface.levels[level]->points, static_cast<std::size_t>(c.width * c.height));
        for (std::size_t i = 0; i < points.size(); ++i)
          ASSERT_NEAR(std::bit_cast<float>(points[i].x), 1.5f, 1e-5f) << width << " x " << height << ", " << i;
      }
    }
  }
}

}  // namespace
}  // namespace cairn
