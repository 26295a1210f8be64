// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "cairn/mapping/mesh.hpp"

namespace cairn {

/// Grid of squares of two triangles each over (0..columns, 0..rows) * step, mapped into space by `at`.
template <class At>
Mesh grid_mesh(int columns, int rows, float step, const At& at) {
  Mesh mesh;
  for (int y = 0; y <= rows; ++y)
    for (int x = 0; x <= columns; ++x) {
      mesh.positions.push_back(at(step * static_cast<float>(x), step * static_cast<float>(y)));
      mesh.normals.emplace_back(0, 0, 1);
    }
  const auto v = [&](int x, int y) { return static_cast<std::uint32_t>(y * (columns + 1) + x); };
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      mesh.triangles.push_back({v(x, y), v(x + 1, y), v(x + 1, y + 1)});
      mesh.triangles.push_back({v(x, y), v(x + 1, y + 1), v(x, y + 1)});
    }
  return mesh;
}

inline Mesh flat_grid(int columns, int rows, float step) {
  return grid_mesh(columns, rows, step, [](float x, float y) { return Eigen::Vector3f(x, y, 0); });
}

/// Wavy square of `side` * `side` * 2 triangles with a texture of noise, which JPEG hardly compresses.
inline Mesh noisy_grid(int side, int texture_size) {
  const float step = 1.0f / static_cast<float>(side);
  Mesh mesh = grid_mesh(side, side, step, [](float x, float y) {
    return Eigen::Vector3f(x, y, 0.1f * std::sin(9 * x) * std::cos(7 * y));
  });
  for (const Eigen::Vector3f& p : mesh.positions) mesh.texture_coordinates.emplace_back(p.x(), p.y());
  mesh.texture = {.width = texture_size, .height = texture_size, .texels = {}};
  std::minstd_rand random(1);
  const auto byte = [&] { return static_cast<std::uint8_t>(random() >> 8); };
  for (int i = 0; i < texture_size * texture_size; ++i) mesh.texture.texels.push_back({byte(), byte(), byte()});
  return mesh;
}

/// Closed sphere of radius 1: a subdivided octahedron.
inline Mesh sphere_mesh(int subdivisions) {
  Mesh mesh;
  mesh.positions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int i = 0; i < subdivisions; ++i) {
    std::vector<std::array<std::uint32_t, 3>> finer;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middle;
    const auto half = [&](std::uint32_t a, std::uint32_t b) {
      const auto [it, is_new] =
          middle.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(mesh.positions.size()));
      if (is_new) mesh.positions.push_back((mesh.positions[a] + mesh.positions[b]).normalized());
      return it->second;
    };
    for (const auto& [a, b, c] : mesh.triangles) {
      const std::uint32_t ab = half(a, b), bc = half(b, c), ca = half(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    mesh.triangles = std::move(finer);
  }
  mesh.normals = mesh.positions;
  return mesh;
}

/// Appends the triangles of another mesh.
inline void append(Mesh& mesh, const Mesh& more) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), more.positions.begin(), more.positions.end());
  mesh.normals.insert(mesh.normals.end(), more.normals.begin(), more.normals.end());
  mesh.weights.insert(mesh.weights.end(), more.weights.begin(), more.weights.end());
  for (const auto& t : more.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

}  // namespace cairn
