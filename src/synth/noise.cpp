// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Measurements of several kinds of depth cameras. Noise figures are from published tests of the sensors, not from
// cairn::SensorModel, which is evaluated with them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

#include "synth/source.hpp"

namespace cairn {
namespace {

constexpr float kColorNoise = 2.0f;  // gray levels

/// Sums of uniform numbers: approximately normal, and unlike std::normal_distribution the same bits with every standard
/// library.
class Normal {
 public:
  Normal(std::uint64_t seed, int frame) : random_(seed * 1000003u + static_cast<std::uint64_t>(frame)) {}
  float operator()() {
    const std::uint64_t r = random_();
    float sum = 0;
    for (int i = 0; i < 4; ++i) sum += static_cast<float>((r >> (16 * i)) & 0xffff);
    return (sum / 65535.0f - 2.0f) * 1.7320508f;
  }
  float uniform() { return static_cast<float>(random_() >> 40) / 16777216.0f; }

 private:
  std::mt19937_64 random_;
};

/// Image of the camera's size, or a coarse grid over it.
struct Grid {
  int width, height;
  [[nodiscard]] std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(std::clamp(y, 0, height - 1)) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(std::clamp(x, 0, width - 1));
  }
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) visit(x, y, at(x, y));
  }
};

/// Spatially correlated noise: normal numbers every `cell` pixels, with linear interpolation.
class Patches {
 public:
  Patches(const Grid& grid, int cell, Normal& normal)
      : cell_(cell), coarse_{grid.width / cell + 2, grid.height / cell + 2}, values_(coarse_.size()) {
    for (float& v : values_) v = normal();
  }
  [[nodiscard]] float operator()(int x, int y) const {
    const int i = x / cell_, j = y / cell_;
    const float u = static_cast<float>(x % cell_) / static_cast<float>(cell_);
    const float v = static_cast<float>(y % cell_) / static_cast<float>(cell_);
    const auto mix = [](float a, float b, float t) { return a + (b - a) * t; };
    const auto value = [&](int k, int l) { return values_[coarse_.at(k, l)]; };
    return mix(mix(value(i, j), value(i + 1, j), u), mix(value(i, j + 1), value(i + 1, j + 1), u), v);
  }

 private:
  int cell_;
  Grid coarse_;
  std::vector<float> values_;
};

float brightness(std::uint32_t rgb) {
  return (static_cast<float>(rgb & 0xff) + static_cast<float>(rgb >> 8 & 0xff) + static_cast<float>(rgb >> 16 & 0xff)) /
         765.0f;
}

/// Khoshelham & Elberink 2012; Handa et al. 2014, sec. IV.
void structured_light(SceneImages& images, const Grid& grid, const Camera& camera, Normal& normal) {
  constexpr float kBaseline = 0.075f;                  // meters
  constexpr float kLateral = 0.5f;                     // pixels, standard deviation
  constexpr float kDisparityNoise = 0.08f;             // pixels, standard deviation
  constexpr float kDisparityStep = 0.125f;             // pixels
  constexpr float kGrazing = 0.15f;                    // cosine
  constexpr float kMinDepth = 0.4f, kMaxDepth = 5.0f;  // meters
  const float bf = kBaseline * static_cast<float>(camera.fx);
  std::vector<float> noisy(images.depth.size(), 0.0f);
  grid.for_each([&](int x, int y, std::size_t i) {
    const int sx = static_cast<int>(std::lround(static_cast<float>(x) + kLateral * normal()));
    const int sy = static_cast<int>(std::lround(static_cast<float>(y) + kLateral * normal()));
    const std::size_t at = grid.at(sx, sy);
    const float z = images.depth[at], noise = kDisparityNoise * normal();
    if (z < kMinDepth || z > kMaxDepth || images.cosine[at] < kGrazing) return;
    const float disparity = std::round((bf / z + noise) / kDisparityStep) * kDisparityStep;
    noisy[i] = bf / disparity;
  });
  images.depth = std::move(noisy);
}

/// Azure Kinect, narrow view without binning (Toelgyessy et al. 2021): noise by returned light, an error periodic in
/// the distance, mixed pixels at edges, millimeters.
void time_of_flight(SceneImages& images, const Grid& grid, Normal& normal) {
  constexpr float kMinDepth = 0.5f, kMaxDepth = 5.4f;       // meters
  constexpr float kMinNoise = 0.0008f, kByLight = 0.0007f;  // meters
  constexpr float kSwing = 0.0015f, kPeriod = 0.75f;        // meters
  constexpr float kMinLight = 0.012f;                       // light below which there is no measurement
  constexpr float kEdge = 0.08f, kMixed = 0.5f;             // meters; share of the edge's pixels
  std::vector<float> noisy(images.depth.size(), 0.0f);
  grid.for_each([&](int x, int y, std::size_t i) {
    float z = images.depth[i];
    const float albedo = 0.25f + 0.75f * brightness(images.color[i]);
    const float light = albedo * std::max(images.cosine[i], 0.0f) / std::max(z * z, 0.01f);
    const float noise = normal(), beside = images.depth[grid.at(x + 1, y)], mixing = normal.uniform(),
                share = normal.uniform();
    if (z < kMinDepth || z > kMaxDepth || light < kMinLight) return;
    if (std::abs(beside - z) > kEdge && beside > 0 && mixing < kMixed) z += share * (beside - z);
    z += (kMinNoise + kByLight / std::sqrt(light) * std::max(z - 0.5f, 0.2f) * 0.5f) * noise +
         kSwing * std::sin(6.2831853f * z / kPeriod);
    noisy[i] = std::round(z * 1000) / 1000;
  });
  images.depth = std::move(noisy);
}

/// RealSense D4xx: disparity with spatially correlated noise, edges off by a pixel or two, holes at bare walls,
/// millimeters.
void stereo(SceneImages& images, const Grid& grid, const Camera& camera, Normal& normal) {
  constexpr float kBaseline = 0.05f;                    // meters
  constexpr float kShared = 0.06f, kOwn = 0.03f;        // pixels of disparity, standard deviation
  constexpr int kPatch = 5, kHole = 24;                 // pixels
  constexpr float kStep = 1.0f / 32, kLateral = 0.7f;   // pixels
  constexpr float kMinDepth = 0.3f, kMaxDepth = 6.0f;   // meters
  constexpr float kMinTexture = 0.012f, kHoles = 0.8f;  // brightness; standard deviations
  const float bf = kBaseline * static_cast<float>(camera.fx);
  const Patches shared(grid, kPatch, normal), holes(grid, kHole, normal), aside(grid, kPatch, normal);
  std::vector<float> noisy(images.depth.size(), 0.0f);
  grid.for_each([&](int x, int y, std::size_t i) {
    const int sx = static_cast<int>(std::lround(static_cast<float>(x) + kLateral * aside(x, y)));
    const std::size_t at = grid.at(sx, y);
    const float z = images.depth[at], noise = kShared * 1.5f * shared(x, y) + kOwn * normal();
    const float texture = std::abs(brightness(images.color[grid.at(x + 2, y)]) - brightness(images.color[i])) +
                          std::abs(brightness(images.color[grid.at(x - 2, y)]) - brightness(images.color[i]));
    if (z < kMinDepth || z > kMaxDepth || images.cosine[at] < 0.1f) return;
    if (texture < kMinTexture && holes(x, y) > kHoles) return;
    const float measured = bf / (std::round((bf / z + noise) / kStep) * kStep);
    if (measured > 0 && measured < 20) noisy[i] = std::round(measured * 1000) / 1000;
  });
  images.depth = std::move(noisy);
}

/// iPhone: few laser points spread over the image, smooth across edges, flattened beyond 2.5 m; with confidence.
void phone_lidar(SceneImages& images, const Grid& grid, Normal& normal) {
  constexpr float kMinDepth = 0.2f, kMaxDepth = 5.0f, kFlat = 2.5f;  // meters
  constexpr int kPatch = 8;                                          // pixels
  constexpr float kShared = 0.003f, kOwn = 0.001f;                   // of the depth
  constexpr float kEdge = 0.04f, kDoubt = 0.3f;                      // of the depth; cosine
  const Patches shared(grid, kPatch, normal);
  std::vector<float> noisy(images.depth.size(), 0.0f);
  images.confidence.assign(images.depth.size(), 0);
  grid.for_each([&](int x, int y, std::size_t i) {
    const float z = images.depth[i], own = normal();
    if (z < kMinDepth || z > kMaxDepth) return;
    const int reach = z > kFlat ? 3 : 1;
    float sum = 0, min_depth = z, max_depth = z;
    int count = 0;
    for (int v = -reach; v <= reach; ++v)
      for (int u = -reach; u <= reach; ++u) {
        const float other = images.depth[grid.at(x + u, y + v)];
        if (other <= 0) continue;
        sum += 1 / other, ++count;
        min_depth = std::min(min_depth, other), max_depth = std::max(max_depth, other);
      }
    const float smooth = static_cast<float>(count) / sum;
    noisy[i] = std::round(smooth * (1 + kShared * 1.5f * shared(x, y) + kOwn * own) * 1000) / 1000;
    const bool edge = max_depth - min_depth > kEdge * z * static_cast<float>(reach) / std::max(images.cosine[i], 0.2f);
    images.confidence[i] = edge ? 0 : z > kFlat || images.cosine[i] < kDoubt ? 128 : 255;
  });
  images.depth = std::move(noisy);
}

void grain(std::vector<std::uint32_t>& color, Normal& normal) {
  for (auto& pixel : color) {
    const float grain = kColorNoise * normal();
    std::uint32_t out = 0xff000000u;
    for (int shift = 0; shift < 24; shift += 8)
      out |= static_cast<std::uint32_t>(std::clamp(static_cast<float>((pixel >> shift) & 0xff) + grain, 0.0f, 255.0f))
             << shift;
    pixel = out;
  }
}

}  // namespace

void check_noise(std::string_view kind) {
  for (const std::string_view known : {"kinect", "tof", "stereo", "lidar", "none"})
    if (kind == known) return;
  throw std::runtime_error(fmt::format("unknown noise '{}': choose kinect, tof, stereo, lidar or none", kind));
}

void add_noise(SceneImages& images, const Camera& camera, std::string_view kind, std::uint64_t seed, int frame,
               std::vector<std::uint32_t>* color) {
  check_noise(kind);
  if (kind == "none") return;
  Normal normal(seed, frame);
  const Grid grid{camera.width, camera.height};
  if (kind == "kinect")
    structured_light(images, grid, camera, normal);
  else if (kind == "tof")
    time_of_flight(images, grid, normal);
  else if (kind == "stereo")
    stereo(images, grid, camera, normal);
  else
    phone_lidar(images, grid, normal);
  grain(color != nullptr ? *color : images.color, normal);
}

}  // namespace cairn
