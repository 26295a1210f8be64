// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/first_mesh.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cairn/mapping/mesh.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

constexpr float kRadius = 0.8f;

/// Sphere with a red upper half and a blue lower half, by its texture.
Mesh sphere(int rings) {
  Mesh mesh;
  const int around = 2 * rings;
  for (int i = 0; i <= rings; ++i)
    for (int k = 0; k <= around; ++k) {
      const float up = std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(rings);
      const float turn = 2 * std::numbers::pi_v<float> * static_cast<float>(k) / static_cast<float>(around);
      mesh.positions.emplace_back(kRadius * std::sin(up) * std::cos(turn), -kRadius * std::cos(up),
                                  kRadius * std::sin(up) * std::sin(turn));
      mesh.texture_coordinates.emplace_back(0.5f, static_cast<float>(i) / static_cast<float>(rings));
      if (i == rings || k == around) continue;
      const auto v = static_cast<std::uint32_t>(i * (around + 1) + k),
                 below = v + static_cast<std::uint32_t>(around) + 1;
      mesh.triangles.push_back({v, v + 1, below});
      mesh.triangles.push_back({v + 1, below + 1, below});
    }
  mesh.texture = {.width = 8, .height = 64, .texels = {}};
  for (int i = 0; i < 64 * 8; ++i)
    mesh.texture.texels.push_back(i < 32 * 8 ? std::array<std::uint8_t, 3>{220, 20, 20}
                                             : std::array<std::uint8_t, 3>{20, 20, 220});
  return mesh;
}

Mesh first_of(const std::filesystem::path& file, std::size_t triangles) {
  write_text(file.parent_path() / "first.glb", first_mesh(file, triangles));
  return read_mesh(file.parent_path() / "first.glb");
}

TEST(FirstMesh, IsCoarserWithTheSameShapeAndColors) {
  const TemporaryFolder folder;
  const Mesh complete = sphere(300);
  write_mesh(folder / "mesh.glb", complete);
  for (const std::size_t max_triangles : {5'000u, 40'000u}) {
    const Mesh first = first_of(folder / "mesh.glb", max_triangles);
    EXPECT_GT(first.triangles.size(), max_triangles / 2);
    EXPECT_LT(first.triangles.size(), max_triangles * 3 / 2);
    ASSERT_EQ(first.colors.size(), first.positions.size());
    const float cell = std::sqrt(8 * std::numbers::pi_v<float> * kRadius * kRadius / static_cast<float>(max_triangles));
    for (std::size_t v = 0; v < first.positions.size(); ++v) {
      const Eigen::Vector3f& p = first.positions[v];
      EXPECT_NEAR(p.norm(), kRadius, cell / 4);
      if (std::abs(p.y()) > 2 * cell) {  // except where both colors meet
        EXPECT_EQ(first.colors[v][0] > 150, p.y() < 0) << p.transpose();
      }
    }
    // Same orientation as before: back faces are not drawn.
    const auto outwards = [](const Mesh& mesh) {
      return std::count_if(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& t) {
        const auto& [a, b, c] = t;
        return (mesh.positions[b] - mesh.positions[a])
                   .cross(mesh.positions[c] - mesh.positions[a])
                   .dot(mesh.positions[a]) > 0;
      });
    };
    const bool is_outwards = outwards(complete) > static_cast<std::ptrdiff_t>(complete.triangles.size() / 2);
    const auto agree =
        is_outwards ? outwards(first) : static_cast<std::ptrdiff_t>(first.triangles.size()) - outwards(first);
    EXPECT_GT(static_cast<double>(agree), 0.98 * static_cast<double>(first.triangles.size()));
  }
}

TEST(FirstMesh, IsTheCompleteMeshIfSmall) {
  const TemporaryFolder folder;
  const Mesh complete = sphere(20);
  const std::size_t without_area = 2 * 2 * 20;  // triangles at the poles
  write_mesh(folder / "mesh.glb", complete);
  EXPECT_EQ(first_of(folder / "mesh.glb", kFirstTriangles).triangles.size(),
            read_mesh(folder / "mesh.glb").triangles.size() - without_area);
}

TEST(FirstMesh, RejectsFilesThatAreNotMeshes) {
  const TemporaryFolder folder;
  write_text(folder / "mesh.glb", "no mesh");
  EXPECT_NE(error_of([&] { (void)first_mesh(folder / "mesh.glb"); }).find("mesh.glb"), std::string::npos);
}

}  // namespace
}  // namespace cairn
