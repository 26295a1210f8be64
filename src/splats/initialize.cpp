// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/initialize.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace cairn {
namespace {

constexpr float kSurfelSigma = 0.6f;       // standard deviation along the surface, in spacings
constexpr float kSurfelThickness = 0.15f;  // relative to the standard deviation along the surface
constexpr float kSurfelOpacity = 0.9f, kBackgroundOpacity = 0.5f;
constexpr int kCell = 4;                  // pixels per side of a background splat
constexpr double kMinBackground = 0.002;  // share of the image
constexpr float kUnseenFootprint = 2;     // of unseen surface, in median footprints
constexpr double kHarmonic0 = 0.28209479177387814;

float logit(float p) { return std::log(p / (1 - p)); }

Eigen::Vector3f to_harmonic(const Eigen::Vector3f& color) {
  return (color.array() - 0.5f) / static_cast<float>(kHarmonic0);
}

void append(Splats& splats, const Eigen::Vector3f& position, const Eigen::Vector3f& scales,
            const Eigen::Quaternionf& rotation, float opacity, const Eigen::Vector3f& color) {
  splats.positions.push_back(position);
  splats.log_scales.emplace_back(scales.array().log());
  splats.rotations.emplace_back(rotation.w(), rotation.x(), rotation.y(), rotation.z());
  splats.opacities.push_back(logit(opacity));
  splats.colors.push_back(to_harmonic(color));
  splats.harmonics.resize(splats.size() * harmonics_per_splat(splats.degree), Eigen::Vector3f::Zero());
}

/// Meters per pixel of the closest view of each triangle.
std::vector<float> footprints_of(const Mesh& mesh, const std::vector<TrainingView>& views,
                                 const std::vector<Eigen::Isometry3f>& poses) {
  std::vector<float> footprints(mesh.triangles.size(), std::numeric_limits<float>::infinity());
  tbb::parallel_for(std::size_t{0}, footprints.size(), [&](std::size_t i) {
    const auto& t = mesh.triangles[i];
    const Eigen::Vector3f center = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    for (std::size_t v = 0; v < views.size(); ++v)
      if (const auto seen = seen_in(views[v], poses[v], center))
        footprints[i] = std::min(footprints[i], static_cast<float>(seen->footprint));
  });
  std::vector<float> finite;
  for (const float f : footprints)
    if (std::isfinite(f)) finite.push_back(f);
  if (finite.empty()) return {};
  std::nth_element(finite.begin(), finite.begin() + static_cast<std::ptrdiff_t>(finite.size() / 2), finite.end());
  const float unseen = kUnseenFootprint * finite[finite.size() / 2];
  for (float& f : footprints)
    if (!std::isfinite(f)) f = unseen;
  return footprints;
}

/// Mean color of the views that see the point, weighted by the pixels per area
/// of surface.
std::optional<Eigen::Vector3f> mean_color(const std::vector<TrainingView>& views,
                                          const std::vector<Eigen::Isometry3f>& poses, const Eigen::Vector3f& point) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float weights = 0;
  for (std::size_t v = 0; v < views.size(); ++v)
    if (const auto seen = seen_in(views[v], poses[v], point)) {
      const auto weight = static_cast<float>(1 / (seen->footprint * seen->footprint));
      sum += weight * color_at(views[v], seen->pixel);
      weights += weight;
    }
  if (weights == 0) return std::nullopt;
  return sum / weights;
}

/// Depth by cell of a view: the mean of its surface, or that of the nearest
/// cell with a surface; empty without any.
std::vector<float> cell_depths(const TrainingView& view, int columns, int rows) {
  const auto cells = static_cast<std::size_t>(columns * rows);
  std::vector<float> depths(cells, 0.0f);
  std::vector<std::size_t> queue;
  for (std::size_t cell = 0; cell < cells; ++cell) {
    float sum = 0;
    int count = 0;
    for (int k = 0; k < kCell * kCell; ++k) {
      const int x = static_cast<int>(cell) % columns * kCell + k % kCell,
                y = static_cast<int>(cell) / columns * kCell + k / kCell;
      const float z = view.depth[static_cast<std::size_t>(y * view.camera.width + x)];
      sum += z, count += z > 0;
    }
    if (count == 0) continue;
    depths[cell] = sum / static_cast<float>(count);
    queue.push_back(cell);
  }
  for (std::size_t next = 0; next < queue.size(); ++next) {  // breadth first
    const int x = static_cast<int>(queue[next]) % columns, y = static_cast<int>(queue[next]) / columns;
    for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
      if (x + dx < 0 || y + dy < 0 || x + dx >= columns || y + dy >= rows) continue;
      const auto cell = static_cast<std::size_t>((y + dy) * columns + x + dx);
      if (depths[cell] > 0) continue;
      depths[cell] = depths[queue[next]];
      queue.push_back(cell);
    }
  }
  return queue.empty() ? std::vector<float>{} : depths;
}

}  // namespace

Splats surfels_of(const Mesh& mesh, const std::vector<TrainingView>& views, std::size_t max_count, int degree) {
  Splats splats;
  splats.degree = degree;
  const std::vector<Eigen::Isometry3f> poses = camera_from_world(views);
  const std::vector<float> footprints = footprints_of(mesh, views, poses);
  if (footprints.empty()) return splats;
  std::vector<double> pixels(footprints.size());  // sum of the pixels on all triangles up to here
  double total = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto& t = mesh.triangles[i];
    const Eigen::Vector3f& a = mesh.positions[t[0]];
    const double area = 0.5 * static_cast<double>((mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a).norm());
    pixels[i] = total += area / (static_cast<double>(footprints[i]) * static_cast<double>(footprints[i]));
  }
  const auto count = static_cast<std::size_t>(std::min(total, static_cast<double>(max_count)));
  const auto spacing_px = static_cast<float>(std::sqrt(total / static_cast<double>(std::max<std::size_t>(1, count))));
  struct Surfel {
    Eigen::Vector3f position, normal, color;
    float spacing = 0;
  };
  std::vector<Surfel> surfels(count);
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    const double at = total * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const auto triangle = std::min<std::size_t>(
        static_cast<std::size_t>(std::upper_bound(pixels.begin(), pixels.end(), at) - pixels.begin()),
        pixels.size() - 1);
    // Low-discrepancy sequence of two dimensions (Roberts 2018, R2).
    double u = std::fmod(0.5 + 0.7548776662466927 * static_cast<double>(i), 1.0),
           v = std::fmod(0.5 + 0.5698402909980532 * static_cast<double>(i), 1.0);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const auto& t = mesh.triangles[triangle];
    const auto mix = [&](const auto& values) -> Eigen::Vector3f {
      return values[t[0]] + static_cast<float>(u) * (values[t[1]] - values[t[0]]) +
             static_cast<float>(v) * (values[t[2]] - values[t[0]]);
    };
    Surfel& s = surfels[i];
    s.position = mix(mesh.positions);
    s.normal = mix(mesh.normals).normalized();
    s.spacing = spacing_px * footprints[triangle];
    const auto color = mean_color(views, poses, s.position);
    const auto& vertex = mesh.colors.empty() ? std::array<std::uint8_t, 4>{128, 128, 128, 255} : mesh.colors[t[0]];
    s.color = color ? *color : Eigen::Vector3f(vertex[0], vertex[1], vertex[2]) / 255.0f;
  });
  for (const Surfel& s : surfels) {
    const float sigma = kSurfelSigma * s.spacing;
    append(splats, s.position, {sigma, sigma, kSurfelThickness * sigma},
           Eigen::Quaternionf::FromTwoVectors(Eigen::Vector3f::UnitZ(), s.normal), kSurfelOpacity, s.color);
  }
  return splats;
}

bool has_background(const TrainingView& view) {
  const auto empty = static_cast<double>(std::count(view.depth.begin(), view.depth.end(), 0.0f));
  return empty > kMinBackground * static_cast<double>(view.depth.size());
}

void append_background(Splats& splats, const TrainingView& view, const SplatImage& image) {
  const int columns = view.camera.width / kCell, rows = view.camera.height / kCell;
  const std::vector<float> depths = cell_depths(view, columns, rows);
  if (depths.empty()) return;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      float opacity = 0;
      for (int k = 0; k < kCell * kCell; ++k)
        opacity += image.opacity[static_cast<std::size_t>((row * kCell + k / kCell) * view.camera.width +
                                                          column * kCell + k % kCell)];
      if (opacity > 0.5f * kCell * kCell) continue;
      const Eigen::Vector2d pixel(column * kCell + 0.5 * (kCell - 1), row * kCell + 0.5 * (kCell - 1));
      const double z = static_cast<double>(depths[static_cast<std::size_t>(row * columns + column)]);
      const Eigen::Vector3d point = view.world_from_camera * (z * view.camera.ray(pixel.x(), pixel.y()));
      const auto sigma = static_cast<float>(static_cast<double>(kSurfelSigma) * kCell * z / view.camera.fx);
      append(splats, point.cast<float>(), {sigma, sigma, kSurfelThickness * sigma},
             Eigen::Quaternionf(view.world_from_camera.linear().cast<float>()), kBackgroundOpacity,
             color_at(view, pixel));
    }
}

}  // namespace cairn
