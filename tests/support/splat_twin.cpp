// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/splat_twin.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace cairn::twin {
namespace {

struct Projected {
  Eigen::Vector2d at;
  Eigen::Matrix2d conic;
  Eigen::Vector3d color;
  double opacity = 0, depth = 0;
};

/// Real spherical harmonics of degree 1 to 3 (Ramamoorthi & Hanrahan 2001), with the signs of Kerbl et al. 2023.
std::array<double, 15> harmonics_at(const Eigen::Vector3d& d) {
  const double x = d.x(), y = d.y(), z = d.z(), pi = 3.14159265358979323846;
  const auto root = [&](double numerator, double denominator) { return std::sqrt(numerator / (denominator * pi)); };
  return {-root(3, 4) * y,
          root(3, 4) * z,
          -root(3, 4) * x,
          root(15, 4) * x * y,
          -root(15, 4) * y * z,
          root(5, 16) * (2 * z * z - x * x - y * y),
          -root(15, 4) * x * z,
          root(15, 16) * (x * x - y * y),
          -root(35, 32) * y * (3 * x * x - y * y),
          root(105, 4) * x * y * z,
          -root(21, 32) * y * (4 * z * z - x * x - y * y),
          root(7, 16) * z * (2 * z * z - 3 * x * x - 3 * y * y),
          -root(21, 32) * x * (4 * z * z - x * x - y * y),
          root(105, 16) * z * (x * x - y * y),
          -root(35, 32) * x * (x * x - 3 * y * y)};
}

Projected project(const SplatParameters& s, int degree, const SplatView& view) {
  const Camera& c = view.camera;
  const Eigen::Vector3d position(s[0], s[1], s[2]), p = view.world_from_camera.inverse() * position;
  Projected projected{
      .at = c.project(p), .conic = {}, .color = {}, .opacity = 1 / (1 + std::exp(-s[10])), .depth = p.z()};
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(s[6], s[7], s[8], s[9]).normalized();
  const Eigen::Vector3d scale(std::exp(s[3]), std::exp(s[4]), std::exp(s[5]));
  const Eigen::Matrix3d factor = rotation.toRotationMatrix() * scale.asDiagonal();
  const Eigen::Vector2d limit(0.65 * c.width / c.fx, 0.65 * c.height / c.fy);
  const Eigen::Vector2d slope = (p.head<2>() / p.z()).cwiseMax(-limit).cwiseMin(limit);
  Eigen::Matrix<double, 2, 3> jacobian;
  jacobian << c.fx / p.z(), 0, -c.fx * slope.x() / p.z(), 0, c.fy / p.z(), -c.fy * slope.y() / p.z();
  const Eigen::Matrix<double, 2, 3> n = jacobian * view.world_from_camera.linear().transpose() * factor;
  projected.conic = (n * n.transpose() + static_cast<double>(view.low_pass) * Eigen::Matrix2d::Identity()).inverse();
  const auto harmonics = harmonics_at((position - view.world_from_camera.translation()).normalized());
  for (int channel = 0; channel < 3; ++channel) {
    double value = 0.5 + std::sqrt(1 / (4 * 3.14159265358979323846)) * s[11 + static_cast<std::size_t>(channel)];
    for (std::size_t k = 0; k < harmonics_per_splat(degree); ++k)
      value += harmonics[k] * s[14 + 3 * k + static_cast<std::size_t>(channel)];
    projected.color[channel] = std::max(0.0, value);
  }
  return projected;
}

}  // namespace

std::vector<SplatParameters> parameters_of(const Splats& splats) {
  std::vector<SplatParameters> all;
  const std::size_t harmonics = harmonics_per_splat(splats.degree);
  for (std::size_t i = 0; i < splats.size(); ++i) {
    SplatParameters& s = all.emplace_back();
    const auto put = [&](const auto& v) {
      for (int k = 0; k < v.size(); ++k) s.push_back(static_cast<double>(v[k]));
    };
    put(splats.positions[i]);
    put(splats.log_scales[i]);
    put(splats.rotations[i]);
    s.push_back(static_cast<double>(splats.opacities[i]));
    put(splats.colors[i]);
    for (std::size_t k = 0; k < harmonics; ++k) put(splats.harmonics[i * harmonics + k]);
  }
  return all;
}

std::vector<double> render_splats(const std::vector<SplatParameters>& splats, int degree, const SplatView& view) {
  std::vector<Projected> projected;
  for (const SplatParameters& s : splats)
    if ((view.world_from_camera.inverse() * Eigen::Vector3d(s[0], s[1], s[2])).z() >= 0.05)
      projected.push_back(project(s, degree, view));
  std::stable_sort(projected.begin(), projected.end(), [](const auto& a, const auto& b) { return a.depth < b.depth; });
  const int width = view.camera.width, height = view.camera.height;
  const auto pixels = static_cast<std::size_t>(width * height);
  std::vector<double> image(5 * pixels, 0.0);
  for (std::size_t i = 0; i < pixels; ++i) {
    const Eigen::Vector2d at(static_cast<int>(i) % width, static_cast<int>(i) / width);
    double transmittance = 1;
    for (const Projected& s : projected) {
      const Eigen::Vector2d d = s.at - at;
      const double alpha = std::min(0.99, s.opacity * std::exp(-0.5 * d.dot(s.conic * d)));
      if (alpha < 1.0 / 255) continue;
      if (transmittance * (1 - alpha) < 1e-4) break;
      for (std::size_t c = 0; c < 3; ++c) image[c * pixels + i] += transmittance * alpha * s.color[static_cast<int>(c)];
      image[4 * pixels + i] += transmittance * alpha * s.depth;
      transmittance *= 1 - alpha;
    }
    image[3 * pixels + i] = 1 - transmittance;
  }
  return image;
}

double splat_loss(const std::vector<double>& image, int width, int height, const std::vector<std::uint32_t>& color,
                  const std::vector<float>& depth, const Exposure& exposure, const LossWeights& weights) {
  const auto pixels = static_cast<std::size_t>(width * height);
  std::array<double, 11> window{};
  for (int k = -5; k <= 5; ++k) window[static_cast<std::size_t>(k + 5)] = std::exp(-k * k / (2 * 1.5 * 1.5));
  const double sum = std::accumulate(window.begin(), window.end(), 0.0);
  for (double& w : window) w /= sum;
  double total = 0;
  for (int channel = 0; channel < 3; ++channel) {
    const auto x_at = [&](std::size_t i) {
      return static_cast<double>(exposure.gain[channel]) * image[static_cast<std::size_t>(channel) * pixels + i] +
             static_cast<double>(exposure.offset[channel]);
    };
    const auto y_at = [&](std::size_t i) { return (color[i] >> (8 * channel) & 255) / 255.0; };
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u) {
        double mx = 0, my = 0, xx = 0, yy = 0, xy = 0;
        for (int dv = -5; dv <= 5; ++dv)
          for (int du = -5; du <= 5; ++du) {
            if (u + du < 0 || v + dv < 0 || u + du >= width || v + dv >= height) continue;
            const double w = window[static_cast<std::size_t>(du + 5)] * window[static_cast<std::size_t>(dv + 5)];
            const auto i = static_cast<std::size_t>((v + dv) * width + u + du);
            const double x = x_at(i), y = y_at(i);
            mx += w * x, my += w * y, xx += w * x * x, yy += w * y * y, xy += w * x * y;
          }
        const double ssim = (2 * mx * my + 1e-4) * (2 * (xy - mx * my) + 9e-4) /
                            ((mx * mx + my * my + 1e-4) * (xx - mx * mx + yy - my * my + 9e-4));
        const auto i = static_cast<std::size_t>(v * width + u);
        const auto structure = static_cast<double>(weights.structure);
        total += ((1 - structure) * std::abs(x_at(i) - y_at(i)) + structure * (1 - ssim)) / 3;
      }
  }
  for (std::size_t i = 0; i < pixels; ++i) {
    const auto z = static_cast<double>(depth[i]), opacity = image[3 * pixels + i];
    if (z > 0)
      total += static_cast<double>(weights.depth) * std::abs(image[4 * pixels + i] - z * opacity) +
               static_cast<double>(weights.opacity) * (1 - opacity);
  }
  return total / static_cast<double>(pixels);
}

}  // namespace cairn::twin
