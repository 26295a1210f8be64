// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "cairn/eval/evaluation.hpp"

namespace cairn {
namespace {

constexpr float kNearPlane = 0.05f;  // meters
constexpr int kRowsPerBand = 32;     // rows per thread

/// Vertex with the attributes interpolated over z.
struct Corner {
  Eigen::Vector3f point;  // camera frame
  Eigen::Vector3f color;
  Eigen::Vector2f texture_coordinates;
};

Corner between(const Corner& a, const Corner& b, float t) {
  return {a.point + t * (b.point - a.point), a.color + t * (b.color - a.color),
          a.texture_coordinates + t * (b.texture_coordinates - a.texture_coordinates)};
}

/// Clips a triangle at the near plane.
std::vector<Corner> clipped(const std::array<Corner, 3>& triangle) {
  std::vector<Corner> polygon;
  for (std::size_t k = 0; k < 3; ++k) {
    const Corner &a = triangle[k], &b = triangle[(k + 1) % 3];
    const bool in = a.point.z() >= kNearPlane;
    if (in) polygon.push_back(a);
    if (in != (b.point.z() >= kNearPlane))
      polygon.push_back(between(a, b, (kNearPlane - a.point.z()) / (b.point.z() - a.point.z())));
  }
  return polygon;
}

Eigen::Vector3f texel(const Texture& t, int x, int y) {
  const auto& c =
      t.texels[static_cast<std::size_t>(std::clamp(y, 0, t.height - 1)) * static_cast<std::size_t>(t.width) +
               static_cast<std::size_t>(std::clamp(x, 0, t.width - 1))];
  return Eigen::Vector3f(c[0], c[1], c[2]);
}

Eigen::Vector3f bilinear(const Texture& t, const Eigen::Vector2f& at) {
  const float x = at.x() * static_cast<float>(t.width) - 0.5f, y = at.y() * static_cast<float>(t.height) - 0.5f;
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  const float u = x - static_cast<float>(i), v = y - static_cast<float>(j);
  return (1 - v) * ((1 - u) * texel(t, i, j) + u * texel(t, i + 1, j)) +
         v * ((1 - u) * texel(t, i, j + 1) + u * texel(t, i + 1, j + 1));
}

/// Camera with several samples per pixel and axis. Sample (i, j) is at ((i + 0.5) / samples - 0.5) of the pixels.
struct SampleCamera {
  int width, height;
  float fx, fy, cx, cy;
};

SampleCamera sample_camera(const Camera& camera, int samples) {
  const auto s = static_cast<float>(samples);
  return {.width = camera.width * samples,
          .height = camera.height * samples,
          .fx = s * static_cast<float>(camera.fx),
          .fy = s * static_cast<float>(camera.fy),
          .cx = s * (static_cast<float>(camera.cx) + 0.5f) - 0.5f,
          .cy = s * (static_cast<float>(camera.cy) + 0.5f) - 0.5f};
}

/// A projected triangle.
struct Projected {
  Eigen::Vector2f at[3];
  float inverse_z[3];
  Corner corner[3];
  const Texture* texture;
  float low_y, high_y;
};

Corner corner_of(const Mesh& mesh, std::uint32_t v, bool is_textured, const Eigen::Isometry3f& camera_from_world) {
  Corner c;
  c.point = camera_from_world * mesh.positions[v];
  c.texture_coordinates = is_textured ? mesh.texture_coordinates[v] : Eigen::Vector2f::Zero();
  if (!mesh.colors.empty())
    c.color = Eigen::Vector3f(mesh.colors[v][0], mesh.colors[v][1], mesh.colors[v][2]);
  else if (!mesh.normals.empty())
    c.color = Eigen::Vector3f::Constant(
        60 + 180 * std::abs((camera_from_world.linear() * mesh.normals[v]).dot(c.point.normalized())));
  else
    c.color = Eigen::Vector3f::Constant(180);
  return c;
}

/// Appends the front-facing triangles that may be in the image, in order.
void project(const Mesh& mesh, const Eigen::Isometry3f& camera_from_world, const SampleCamera& camera,
             std::vector<Projected>& triangles) {
  const bool is_textured = !mesh.texture_coordinates.empty() && !mesh.texture.texels.empty();
  for (const auto& t : mesh.triangles) {
    std::array<Corner, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) corners[k] = corner_of(mesh, t[k], is_textured, camera_from_world);
    const Eigen::Vector3f normal = (corners[1].point - corners[0].point).cross(corners[2].point - corners[0].point);
    if (normal.dot(corners[0].point) >= 0) continue;  // back face
    const std::vector<Corner> polygon = clipped(corners);
    for (std::size_t k = 1; k + 1 < polygon.size(); ++k) {
      Projected d{.texture = is_textured ? &mesh.texture : nullptr};
      d.corner[0] = polygon[0], d.corner[1] = polygon[k], d.corner[2] = polygon[k + 1];
      Eigen::Vector2f low = Eigen::Vector2f::Constant(1e30f), high = -low;
      for (int c = 0; c < 3; ++c) {
        const Eigen::Vector3f& p = d.corner[c].point;
        d.inverse_z[c] = 1 / p.z();
        d.at[c] = {camera.fx * p.x() / p.z() + camera.cx, camera.fy * p.y() / p.z() + camera.cy};
        low = low.cwiseMin(d.at[c]);
        high = high.cwiseMax(d.at[c]);
      }
      if (high.x() < 0 || high.y() < 0 || low.x() > static_cast<float>(camera.width) ||
          low.y() > static_cast<float>(camera.height))
        continue;
      d.low_y = low.y(), d.high_y = high.y();
      triangles.push_back(d);
    }
  }
}

/// Triangle indices per band of rows.
std::vector<std::vector<std::uint32_t>> triangles_by_band(const std::vector<Projected>& triangles, int height) {
  std::vector<std::vector<std::uint32_t>> bands(static_cast<std::size_t>((height + kRowsPerBand - 1) / kRowsPerBand));
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const int first = std::max(0, static_cast<int>(triangles[i].low_y) / kRowsPerBand),
              last = std::min(static_cast<int>(bands.size()) - 1, static_cast<int>(triangles[i].high_y) / kRowsPerBand);
    for (int b = first; b <= last; ++b) bands[static_cast<std::size_t>(b)].push_back(i);
  }
  return bands;
}

/// Rendered samples.
struct Samples {
  int width, height;
  std::vector<float> inverse_z;  // 0: empty
  std::vector<Eigen::Vector3f> color;

  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
};

/// Rasterizes the rows from `first` to `last` of a triangle.
void draw(const Projected& d, int first, int last, Samples& samples) {
  const Eigen::Vector2f ab = d.at[1] - d.at[0], ac = d.at[2] - d.at[0];
  const float area = ab.x() * ac.y() - ab.y() * ac.x();
  if (area == 0) return;
  const int y0 = std::max(first, static_cast<int>(std::ceil(d.low_y))),
            y1 = std::min({last, samples.height - 1, static_cast<int>(std::floor(d.high_y))});
  const float low_x = std::min({d.at[0].x(), d.at[1].x(), d.at[2].x()}),
              high_x = std::max({d.at[0].x(), d.at[1].x(), d.at[2].x()});
  const int x0 = std::max(0, static_cast<int>(std::ceil(low_x))),
            x1 = std::min(samples.width - 1, static_cast<int>(std::floor(high_x)));
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) {
      const Eigen::Vector2f q = Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y)) - d.at[0];
      const float v = (q.x() * ac.y() - q.y() * ac.x()) / area, w = (ab.x() * q.y() - ab.y() * q.x()) / area,
                  u = 1 - v - w;
      if (u < -1e-5f || v < -1e-5f || w < -1e-5f) continue;
      const float inverse = u * d.inverse_z[0] + v * d.inverse_z[1] + w * d.inverse_z[2];
      const std::size_t at = samples.index(x, y);
      if (inverse <= samples.inverse_z[at]) continue;
      samples.inverse_z[at] = inverse;
      const float pu = u * d.inverse_z[0] / inverse, pv = v * d.inverse_z[1] / inverse, pw = 1 - pu - pv;
      const auto& [a, b, c] = d.corner;
      samples.color[at] = d.texture != nullptr
                              ? bilinear(*d.texture, pu * a.texture_coordinates + pv * b.texture_coordinates +
                                                         pw * c.texture_coordinates)
                              : Eigen::Vector3f(pu * a.color + pv * b.color + pw * c.color);
    }
}

/// Averages the color over the samples of a pixel; takes the depth of the first covered sample.
RenderedView resolve(const Samples& samples, const Camera& camera, int per_side) {
  RenderedView view;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      int hit = 0;
      float z = 0;
      for (int j = 0; j < per_side; ++j)
        for (int i = 0; i < per_side; ++i) {
          const std::size_t at = samples.index(x * per_side + i, y * per_side + j);
          if (samples.inverse_z[at] <= 0) continue;
          if (z == 0) z = 1 / samples.inverse_z[at];
          sum += samples.color[at];
          ++hit;
        }
      view.depth.push_back(z);
      std::uint32_t word = 0xff000000u;
      if (hit > 0)
        for (int c = 0; c < 3; ++c)
          word |= static_cast<std::uint32_t>(std::clamp(std::lround(sum[c] / static_cast<float>(hit)), 0l, 255l))
                  << (8 * c);
      view.color.push_back(word);
    }
  return view;
}

}  // namespace

RenderedView render_mesh(const std::vector<Mesh>& parts, const Camera& camera,
                         const Eigen::Isometry3d& world_from_camera, int samples) {
  const SampleCamera sampled = sample_camera(camera, samples);
  const Eigen::Isometry3f camera_from_world = world_from_camera.inverse().cast<float>();
  std::vector<Projected> triangles;
  for (const Mesh& mesh : parts) project(mesh, camera_from_world, sampled, triangles);
  const auto bands = triangles_by_band(triangles, sampled.height);
  Samples drawn{.width = sampled.width, .height = sampled.height, .inverse_z = {}, .color = {}};
  drawn.inverse_z.resize(drawn.index(0, sampled.height), 0);
  drawn.color.resize(drawn.inverse_z.size(), Eigen::Vector3f::Zero());
  tbb::parallel_for(std::size_t{0}, bands.size(), [&](std::size_t b) {
    const int first = static_cast<int>(b) * kRowsPerBand;
    for (const std::uint32_t i : bands[b]) draw(triangles[i], first, first + kRowsPerBand - 1, drawn);
  });
  return resolve(drawn, camera, samples);
}

}  // namespace cairn
