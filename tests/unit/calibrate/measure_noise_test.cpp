// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/io/measure_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "cairn/io/source.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

constexpr int kFrames = 8;
constexpr double kTolerance = 0.15;  // relative error of the measured standard deviation

/// Upright box, rotated about the vertical axis; seen from inside if it contains the camera.
struct Box {
  Eigen::Vector3d center, half_size;
  double yaw = 0;
  float brightness = 0.6f;
};

/// Exact images of a room with boxes, and the face of each pixel.
struct ExactImages {
  SceneImages images;
  std::vector<int> faces;
};

std::vector<Box> furnished_room() {
  std::vector<Box> boxes = {{{0, 0, 1}, {2.6, 1.3, 3.4}, 0.15, 0.7f}};
  std::mt19937 random(7);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 16; ++i) {
    const double z = 0.55 + 0.2 * i;
    boxes.push_back({{number(-0.5, 0.5) * z, number(-0.4, 0.4) * z, z + 0.1},
                     {number(0.05, 0.12) * z, number(0.05, 0.12) * z, 0.1},
                     number(-0.6, 0.6),
                     static_cast<float>(number(0.4, 0.9))});
  }
  return boxes;
}

ExactImages render(const std::vector<Box>& boxes, const Camera& camera, const Eigen::Isometry3d& world_from_camera) {
  ExactImages exact;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = world_from_camera.linear() * camera.ray(x, y);
      double best = 100, cosine = 0;
      int face = -1;
      for (std::size_t b = 0; b < boxes.size(); ++b) {
        const Eigen::Matrix3d box_from_world = Eigen::AngleAxisd(-boxes[b].yaw, Eigen::Vector3d::UnitY()).matrix();
        const Eigen::Vector3d origin = box_from_world * (world_from_camera.translation() - boxes[b].center);
        const Eigen::Vector3d direction = box_from_world * ray;
        double enter = -1e9, leave = 1e9;
        int enter_axis = 0, leave_axis = 0;
        for (int k = 0; k < 3; ++k) {
          const double a = (-boxes[b].half_size[k] - origin[k]) / direction[k];
          const double c = (boxes[b].half_size[k] - origin[k]) / direction[k];
          if (std::min(a, c) > enter) enter = std::min(a, c), enter_axis = k;
          if (std::max(a, c) < leave) leave = std::max(a, c), leave_axis = k;
        }
        if (enter > leave || leave <= 0) continue;
        const double t = enter > 0 ? enter : leave;
        const int axis = enter > 0 ? enter_axis : leave_axis;
        if (t >= best) continue;
        best = t, cosine = std::abs(direction[axis]) / ray.norm();
        face = static_cast<int>(b) * 6 + axis * 2 + (direction[axis] > 0 ? 1 : 0);
      }
      const auto gray =
          static_cast<std::uint32_t>(255 * boxes[static_cast<std::size_t>(std::max(face, 0) / 6)].brightness);
      exact.images.depth.push_back(face < 0 ? 0 : static_cast<float>(best));
      exact.images.cosine.push_back(static_cast<float>(cosine));
      exact.images.color.push_back(0xff000000u | gray << 16 | gray << 8 | gray);
      exact.faces.push_back(face);
    }
  return exact;
}

const std::vector<ExactImages>& exact_frames() {
  static const std::vector<ExactImages> frames = [] {
    std::vector<ExactImages> all;
    for (int i = 0; i < kFrames; ++i) {
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.rotate(Eigen::AngleAxisd(0.08 * i - 0.3, Eigen::Vector3d(0.1, 1, 0).normalized()));
      pose.pretranslate(Eigen::Vector3d(0.03 * i - 0.1, 0.02 * i, -0.02 * i));
      all.push_back(render(furnished_room(), Camera{}, pose));
    }
    return all;
  }();
  return frames;
}

using Noise = std::function<void(SceneImages&, int)>;
/// Error of a sensor without randomness, as a function of depth; excluded from its standard deviation.
using Bias = std::function<double(double)>;

struct Comparison {
  DepthNoise noise;
  std::vector<std::pair<float, double>> truth;  // depth and standard deviation, meters
};

/// Measured noise of the furnished room, and the standard deviation of noisy minus exact depth on faces inclined by at
/// most 45 degrees, 4 pixels from their edges.
Comparison compare(
    const Noise& add, const Bias& bias = [](double) { return 0.0; }) {
  const Camera camera;
  constexpr double kFirst = 0.55, kRatio = 1.12;     // meters, between depths
  constexpr int kDepths = 18;                        // up to 4 m
  std::vector<std::array<double, 4>> sums(kDepths);  // number, depth, error, squared error
  std::vector<std::vector<float>> noisy;
  for (int i = 0; i < kFrames; ++i) {
    const ExactImages& exact = exact_frames()[static_cast<std::size_t>(i)];
    SceneImages images = exact.images;
    add(images, i);
    for (int y = 4; y + 4 < camera.height; ++y)
      for (int x = 4; x + 4 < camera.width; ++x) {
        const auto at = [&](int u, int v) { return static_cast<std::size_t>(v * camera.width + u); };
        const double z = static_cast<double>(exact.images.depth[at(x, y)]);
        if (images.depth[at(x, y)] <= 0 || z < kFirst) continue;
        bool inside = true;
        for (const int v : {-4, 0, 4})
          for (const int u : {-4, 0, 4}) inside &= exact.faces[at(x + u, y + v)] == exact.faces[at(x, y)];
        if (!inside) continue;
        const auto slope = [&](std::size_t after, std::size_t before) {
          return camera.fx * z *
                 (1 / static_cast<double>(exact.images.depth[after]) -
                  1 / static_cast<double>(exact.images.depth[before])) /
                 8;
        };
        if (std::hypot(slope(at(x + 4, y), at(x - 4, y)), slope(at(x, y + 4), at(x, y - 4))) > 1) continue;
        const double error = static_cast<double>(images.depth[at(x, y)]) - z - bias(z);
        constexpr double kMaxError = 0.2;  // of the depth; larger ones are flying pixels
        if (std::abs(error) > kMaxError * z) continue;
        const auto bin = static_cast<std::size_t>(std::log(z / kFirst) / std::log(kRatio));
        if (bin >= kDepths) continue;
        sums[bin][0] += 1, sums[bin][1] += z, sums[bin][2] += error, sums[bin][3] += error * error;
      }
    noisy.push_back(std::move(images.depth));
  }
  Comparison result{.noise = measure_depth_noise(noisy, camera)};
  constexpr double kMinPixels = 20000;
  for (const auto& [n, z, e, ee] : sums)
    if (n >= kMinPixels) result.truth.emplace_back(z / n, std::sqrt(ee / n - e * e / n / n));
  return result;
}

void expect_measured(const Comparison& c, double tolerance = kTolerance) {
  ASSERT_GE(c.truth.size(), 10u);
  for (const auto& [z, truth] : c.truth) {
    const auto sigma = c.noise.sigma(z);
    ASSERT_TRUE(sigma) << z << " m";
    EXPECT_NEAR(static_cast<double>(*sigma) / truth, 1, tolerance)
        << "at " << z << " m, true: " << 1000 * truth << " mm";
  }
}

void expect_fitted(const Comparison& c, double tolerance = kTolerance) {
  for (const auto& [z, truth] : c.truth)
    EXPECT_NEAR(static_cast<double>(c.noise.model.sigma(z)) / truth, 1, tolerance) << "at " << z << " m";
}

Noise sensor(const std::string& kind) {
  return [kind](SceneImages& images, int frame) { add_noise(images, Camera{}, kind, 3, frame); };
}

/// Independent normal noise with a standard deviation given by depth.
Noise independent(const std::function<double(double)>& sigma) {
  return [sigma](SceneImages& images, int frame) {
    std::mt19937 random(static_cast<unsigned>(frame));
    std::normal_distribution<double> normal;
    for (float& z : images.depth) {
      const double depth = static_cast<double>(z);
      z = static_cast<float>(depth + sigma(depth) * normal(random));
    }
  };
}

TEST(MeasureNoise, FindsConstantNoise) {
  const auto c = compare(independent([](double) { return 0.005; }));
  expect_measured(c);
  expect_fitted(c);
  EXPECT_LT(c.noise.correlation_px, 3);
  EXPECT_EQ(c.noise.step(1), 0);
}

TEST(MeasureNoise, FindsNoiseProportionalToDepth) {
  const auto c = compare(independent([](double z) { return 0.01 * z; }));
  expect_measured(c);
  constexpr double kFormError = 0.35;  // of floor + growth (z - sharpest)^2, which is not linear in depth
  expect_fitted(c, kFormError);
}

TEST(MeasureNoise, FindsNoiseProportionalToSquaredDepth) {
  const auto c = compare(independent([](double z) { return 0.006 * z * z; }));
  expect_measured(c);
  expect_fitted(c);
}

TEST(MeasureNoise, FindsTheNoiseAndTheDisparityStepOfAKinect) {
  const auto c = compare(sensor("kinect"));
  expect_measured(c);
  expect_fitted(c);
  EXPECT_NEAR(static_cast<double>(c.noise.inverse_depth_step), 0.125 / (0.075 * 525), 2e-4);
  EXPECT_LT(c.noise.correlation_px, 3.5f);
}

TEST(MeasureNoise, FindsTheRandomPartOfATimeOfFlightCamera) {
  const auto c = compare(sensor("tof"), [](double z) { return 0.0015 * std::sin(2 * 3.14159265 * z / 0.75); });
  expect_measured(c);
  EXPECT_NEAR(static_cast<double>(c.noise.depth_step), 0.001, 2e-5);
  EXPECT_GT(c.noise.flying, 0.2f);
}

TEST(MeasureNoise, ExtrapolatesTheCorrelatedNoiseOfStereo) {
  const auto c = compare(sensor("stereo"));
  expect_measured(c);
  EXPECT_GT(c.noise.correlation_px, 4);
}

TEST(MeasureNoise, ExtrapolatesTheSmoothedDepthOfAPhone) {
  const auto c = compare(sensor("lidar"));
  expect_measured(c);
  EXPECT_GT(c.noise.correlation_px, 6);
}

TEST(MeasureNoise, IgnoresHolesAndFlyingPixels) {
  const Noise noise = independent([](double z) { return 0.002 * z; });
  const auto c = compare([&](SceneImages& images, int frame) {
    noise(images, frame);
    std::mt19937 random(static_cast<unsigned>(frame) + 100);
    for (float& z : images.depth) {
      const auto number = random() % 100;
      if (number < 6) z = 0;
      if (number == 6) z *= 1.3f;
    }
  });
  expect_measured(c);
  EXPECT_NEAR(static_cast<double>(c.noise.holes), 0.06, 0.01);
}

TEST(MeasureNoise, FitsASingleDepthOfASmallCamera) {
  Camera camera;
  camera.width = 256, camera.height = 192;
  camera.fx = camera.fy = 213, camera.cx = 127.5, camera.cy = 95.5;
  constexpr float kDepth = 2, kSigma = 0.003f;  // meters
  std::mt19937 random(5);
  std::normal_distribution<float> noise(kDepth, kSigma);
  std::vector<float> wall(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  for (float& z : wall) z = noise(random);
  const DepthNoise measured = measure_depth_noise({wall}, camera);
  ASSERT_TRUE(measured.sigma(kDepth));
  EXPECT_NEAR(*measured.sigma(kDepth), kSigma, 0.1f * kSigma);
  EXPECT_NEAR(measured.model.sigma(kDepth), kSigma, 0.1f * kSigma);
}

TEST(MeasureNoise, FindsNothingWithoutPlanarPatches) {
  const Camera camera;
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  const DepthNoise holes = measure_depth_noise({std::vector<float>(pixels, 0.0f)}, camera);
  EXPECT_TRUE(holes.samples.empty());
  EXPECT_EQ(holes.holes, 1);
  EXPECT_FALSE(holes.sigma(1));
  std::mt19937 random(1);
  std::vector<float> scattered(pixels);
  for (float& z : scattered) z = std::uniform_real_distribution<float>(0.5f, 4.0f)(random);
  EXPECT_TRUE(measure_depth_noise({scattered}, camera).samples.empty());
  EXPECT_TRUE(measure_depth_noise({}, camera).samples.empty());
}

TEST(MeasureNoise, RejectsAnImageOfAnotherSize) {
  EXPECT_EQ(error_of([] {
              (void)measure_depth_noise({{1, 2, 3}}, Camera{});
            }),
            "depth image of 3 pixels: the camera has 640x480");
}

/// Range of noise of a recording at a depth, from published tests of its sensor.
struct Expected {
  const char* recording;
  float depth, low, high;  // meters
};

class MeasureNoiseOfARecording : public testing::TestWithParam<Expected> {};

TEST_P(MeasureNoiseOfARecording, AgreesWithPublishedTestsOfTheSensor) {
  const Expected& expected = GetParam();
  CAIRN_REQUIRE_DATA(expected.recording);
  const auto source = open_source((data_folder() / expected.recording).string(),
                                  {.range = {.end = 96, .step = 6}, .find_color_camera = false});
  std::vector<std::vector<float>> images;
  while (auto frame = source->next())
    if (!frame->problem) images.push_back(std::move(frame->depth));
  const auto sigma = measure_depth_noise(images, source->rig().depth).sigma(expected.depth);
  ASSERT_TRUE(sigma);
  EXPECT_GT(*sigma, expected.low);
  EXPECT_LT(*sigma, expected.high);
}

// Kinect: 1.4 to 3 mm at 1 m, 6 to 12 mm at 2 m (Khoshelham & Elberink 2012; Nguyen, Izadi & Lovell 2012). D435: 0.05
// to 0.15 pixels of disparity.
INSTANTIATE_TEST_SUITE_P(Each, MeasureNoiseOfARecording,
                         testing::Values(Expected{"tum_fr1_rpy_400", 1, 0.001f, 0.003f},
                                         Expected{"7scenes_redkitchen_600", 2, 0.004f, 0.012f},
                                         Expected{"realsense_d435_300", 1, 0.0015f, 0.006f}),
                         [](const auto& each) { return std::string(each.param.recording); });

}  // namespace
}  // namespace cairn
