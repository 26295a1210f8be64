// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/tiles_above.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "cairn/mapping/mesh.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kSide = 20;  // squares of a cell's surface

/// A meter of a wavy floor, red where x is below 2 and blue beyond.
Mesh wavy_floor(int cell) {
  Mesh mesh;
  for (int j = 0; j <= kSide; ++j)
    for (int i = 0; i <= kSide; ++i) {
      const float x = static_cast<float>(cell * kSide + i) / kSide, z = static_cast<float>(j) / kSide;
      mesh.positions.emplace_back(x, 0.05f * std::sin(9 * x) * std::cos(7 * z), z);
      mesh.normals.emplace_back(0.0f, -1.0f, 0.0f);
      mesh.colors.push_back(x < 2 ? std::array<std::uint8_t, 4>{200, 0, 0, 255}
                                  : std::array<std::uint8_t, 4>{0, 0, 200, 255});
    }
  const auto at = [](int i, int j) { return static_cast<std::uint32_t>(j * (kSide + 1) + i); };
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

/// Coordinates z and y of the vertices at x.
std::set<std::pair<float, float>> line_at(const Mesh& mesh, float x) {
  std::set<std::pair<float, float>> line;
  for (const Eigen::Vector3f& p : mesh.positions)
    if (p.x() == x) line.emplace(p.z(), p.y());
  return line;
}

class TilesAbove : public testing::Test {
 protected:
  CellTile cell(int number, const Mesh& mesh) {
    const fs::path file = folder / ("cell" + std::to_string(number) + ".glb");
    write_mesh(file, mesh);
    CellTile made{.cell = {number, 0, 0}, .tile = {.error = 0.01, .is_tileset = true}, .mesh = file};
    made.tile.content = "tiles/" + std::to_string(number) + "/tileset.json";
    for (const Eigen::Vector3f& p : mesh.positions) made.tile.box.extend(p);
    return made;
  }
  TemporaryFolder folder;
};

TEST_F(TilesAbove, ShowTheirChildrenCoarserWithoutCracks) {
  std::vector<CellTile> cells;
  for (int i = 0; i < 4; ++i) cells.push_back(cell(i, wavy_floor(i)));
  const Tile root = tiles_above(cells, folder.path());
  ASSERT_EQ(root.children.size(), 2u);
  std::vector<Mesh> halves;
  for (const Tile& half : root.children) {
    EXPECT_EQ(half.children.size(), 2u);
    EXPECT_FALSE(half.is_tileset);
    EXPECT_GT(half.error, 0.01);
    EXPECT_GE(root.error, half.error);
    halves.push_back(read_mesh(folder / half.content));
    EXPECT_LT(halves.back().triangles.size(), 2u * 2 * kSide * kSide / 3);
  }
  const auto between = line_at(wavy_floor(1), 2);
  EXPECT_EQ(between.size(), static_cast<std::size_t>(kSide) + 1);
  for (const Mesh& half : halves) {
    EXPECT_EQ(line_at(half, 2), between);
    const float inside = &half == halves.data() ? 1.0f : 3.0f;
    EXPECT_LT(line_at(half, inside).size(), between.size());  // no longer a border
  }
  EXPECT_FLOAT_EQ(root.box.sizes().x(), 4);
  EXPECT_LT(read_mesh(folder / root.content).triangles.size(), halves[0].triangles.size());
}

TEST_F(TilesAbove, OfCellsAroundZeroAreOne) {
  const Tile root = tiles_above({cell(-1, wavy_floor(-1)), cell(0, wavy_floor(0))}, folder.path());
  EXPECT_EQ(root.children.size(), 2u);
  EXPECT_TRUE(root.children[0].is_tileset);
  EXPECT_TRUE(fs::exists(folder / root.content));
}

TEST_F(TilesAbove, HaveTheColorsOfATextureBetweenVertices) {
  // Two triangles of a floor with a green middle.
  Mesh flat;
  flat.positions = {{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}};
  flat.normals.assign(4, {0, -1, 0});
  flat.texture_coordinates = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  flat.triangles = {{0, 1, 2}, {0, 2, 3}};
  flat.texture = {.width = 64, .height = 64, .texels = {}};
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x)
      flat.texture.texels.push_back(std::abs(x - 32) < 16 && std::abs(y - 32) < 16
                                        ? std::array<std::uint8_t, 3>{0, 200, 0}
                                        : std::array<std::uint8_t, 3>{200, 200, 200});
  Mesh beside = wavy_floor(1);
  const Tile root = tiles_above({cell(0, flat), cell(1, beside)}, folder.path());
  const Mesh mesh = read_mesh(folder / root.content);
  int greenish = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) greenish += mesh.colors[v][1] > mesh.colors[v][0] + 50;
  EXPECT_GE(greenish, 3);
}

}  // namespace
}  // namespace cairn
