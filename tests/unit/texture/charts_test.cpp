// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "texture/charts.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "eval/mesh_surface.hpp"
#include "support/meshes.hpp"

namespace cairn {
namespace {

constexpr float kTexel = 0.01f;

/// Ramp with two turns around the z axis, nearly level everywhere: its turns overlap in z.
Mesh spiral() {
  return grid_mesh(200, 8, 0.05f, [](float along, float across) {
    const float angle = along * 1.2566f, radius = 0.5f + across;
    return Eigen::Vector3f(radius * std::cos(angle), radius * std::sin(angle), 0.05f * angle);
  });
}

std::vector<Chart> charts_of(const Mesh& mesh, int max_size) {
  return make_charts(mesh, std::vector(mesh.positions.size(), kTexel), max_size);
}

/// Expects each triangle in one chart, and no texel in two triangles.
void expect_sound(const Mesh& mesh) {
  const std::vector<Chart> charts = charts_of(mesh, 512);
  std::vector<int> used(mesh.triangles.size(), 0);
  for (const Chart& chart : charts)
    for (const std::uint32_t t : chart.triangles) ++used[t];
  for (const int n : used) ASSERT_EQ(n, 1);
  const auto atlas = pack(mesh, charts, 2048);
  ASSERT_TRUE(atlas);
  ASSERT_EQ(atlas->mesh.triangles.size(), mesh.triangles.size());
  const int width = atlas->mesh.texture.width, height = atlas->mesh.texture.height;
  std::vector<int> covered(static_cast<std::size_t>(width * height), 0);
  for (const auto& t : atlas->mesh.triangles) {
    Eigen::Vector2f p[3];
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = atlas->mesh.texture_coordinates[t[k]].cwiseProduct(
          Eigen::Vector2f(static_cast<float>(width), static_cast<float>(height)));
      ASSERT_TRUE((p[k].array() >= 1).all());
    }
    const Eigen::Vector2f low = p[0].cwiseMin(p[1]).cwiseMin(p[2]), high = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
    ASSERT_LE(high.x(), static_cast<float>(width - 1));
    ASSERT_LE(high.y(), static_cast<float>(height - 1));
    const auto side = [](const Eigen::Vector2f& a, const Eigen::Vector2f& b, const Eigen::Vector2f& q) {
      return (b.x() - a.x()) * (q.y() - a.y()) - (b.y() - a.y()) * (q.x() - a.x());
    };
    const float turn = side(p[0], p[1], p[2]);
    for (int y = static_cast<int>(low.y()); y <= static_cast<int>(high.y()); ++y)
      for (int x = static_cast<int>(low.x()); x <= static_cast<int>(high.x()); ++x) {
        const Eigen::Vector2f q(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
        constexpr float kInside = 0.02f;  // texels^2: on a side both may claim a texel
        bool inside = true;
        for (std::size_t k = 0; k < 3; ++k)
          inside = inside && side(p[k], p[(k + 1) % 3], q) * (turn > 0 ? 1 : -1) > kInside;
        if (!inside) continue;
        ASSERT_EQ(covered[static_cast<std::size_t>(y * width + x)]++, 0) << x << " " << y;
      }
  }
  // Texels are on the surface, except slightly beyond its borders at the rim of a chart.
  const MeshSurface surface(mesh);
  std::set<std::size_t> texels;
  std::size_t on_surface = 0, points = 0;
  for (const TextureAtlas::Tile& tile : atlas->tiles)
    for (std::size_t k = 0; k < shader::kTileTexels; ++k) {
      const shader::Texel point = atlas->point(tile, k);
      ASSERT_EQ(point.normal == 0, tile.triangles[k] == kNone);
      if (point.normal == 0) continue;
      ++points;
      ASSERT_TRUE(texels.insert(atlas->texel(tile, k)).second);
      const double distance = surface.distance(Eigen::Vector3f(point.position));
      ASSERT_LT(distance, 6 * static_cast<double>(kTexel));
      on_surface += distance < 1e-4;
    }
  EXPECT_GT(static_cast<double>(on_surface), 0.5 * static_cast<double>(points));
}

TEST(Charts, OfASphereCoverItOnce) { expect_sound(sphere_mesh(4)); }
TEST(Charts, OfAPlaneCoverItOnce) { expect_sound(flat_grid(40, 30, 0.02f)); }
TEST(Charts, OfASpiralStairDoNotCoverEachOther) { expect_sound(spiral()); }

TEST(Charts, HaveTheResolutionOfTheirViews) {
  // Two planes face away from each other: one seen from 1 m, the other from 4 m.
  Mesh mesh = flat_grid(20, 20, 0.02f);
  std::vector<float> texels(mesh.positions.size(), 0.002f);
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  const Mesh far = flat_grid(20, 20, 0.02f);
  for (const Eigen::Vector3f& p : far.positions) mesh.positions.emplace_back(p - Eigen::Vector3f(0, 0, 1));
  for (const auto& [a, b, c] : far.triangles) mesh.triangles.push_back({first + a, first + c, first + b});
  texels.resize(mesh.positions.size(), 0.008f);
  const std::vector<Chart> charts = make_charts(mesh, texels, 512);
  ASSERT_EQ(charts.size(), 2u);
  const auto width = [&](std::size_t i) { return (charts[i].high - charts[i].low).maxCoeff(); };
  EXPECT_NEAR(std::max(width(0), width(1)) / std::min(width(0), width(1)), 4, 0.1);
}

TEST(Charts, OfAPlaneAreOne) { EXPECT_EQ(charts_of(flat_grid(40, 30, 0.02f), 512).size(), 1u); }

TEST(Charts, ThatAreTooLargeAreCut) {
  const Mesh mesh = flat_grid(100, 20, 0.1f);  // 1000 texels long
  EXPECT_FALSE(pack(mesh, charts_of(mesh, 2048), 256));
  const auto charts = charts_of(mesh, 600);
  EXPECT_EQ(charts.size(), 2u);
  EXPECT_TRUE(pack(mesh, charts, 600));
}

TEST(Charts, AreAlignedWithTheirLongerSide) {
  // Rotated by 30 degrees, the rectangle still fills its area.
  const Mesh mesh = grid_mesh(
      40, 20, 0.02f, [](float x, float y) { return Eigen::Vector3f(0.866f * x - 0.5f * y, 0.5f * x + 0.866f * y, 1); });
  const auto atlas = pack(mesh, charts_of(mesh, 512), 512);
  ASSERT_TRUE(atlas);
  std::size_t points = 0;
  for (const TextureAtlas::Tile& tile : atlas->tiles)
    for (const std::uint32_t triangle : tile.triangles) points += triangle != kNone;
  EXPECT_GT(static_cast<double>(points), 0.8 * atlas->mesh.texture.width * atlas->mesh.texture.height);
}

TEST(FillBetween, SpreadsKnownColors) {
  Texture texture{64, 64, {}};
  texture.texels.assign(64 * 64, {0, 0, 0});
  std::vector<bool> known(texture.texels.size(), false);
  for (std::size_t y = 0; y < 64; ++y)
    for (std::size_t x = 0; x < 8; ++x) {
      texture.texels[64 * y + x] = {200, 100, 50};
      known[64 * y + x] = true;
    }
  fill_between(texture, known);
  for (const auto& t : texture.texels) EXPECT_EQ(t, (std::array<std::uint8_t, 3>{200, 100, 50}));
}

}  // namespace
}  // namespace cairn
