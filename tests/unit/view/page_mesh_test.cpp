// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/page_mesh.hpp"

#include <gtest/gtest.h>

#include "cairn/mapping/mesh.hpp"
#include "support/files.hpp"
#include "support/meshes.hpp"

namespace cairn {
namespace {

constexpr int kTextureSize = 1024;  // noise: 0.8 MB as JPEG

class PageMesh : public testing::Test {
 protected:
  PageMesh() { write_mesh(folder / "mesh.glb", noisy_grid(100, kTextureSize)); }
  [[nodiscard]] Mesh shown(std::size_t max_bytes) const {
    const std::string glb = page_mesh(folder / "mesh.glb", max_bytes);
    EXPECT_LE(glb.size(), max_bytes);
    write_text(folder / "shown.glb", glb);
    return read_mesh_parts(folder / "shown.glb").at(0);
  }
  TemporaryFolder folder;
  std::size_t triangles = 2 * 100 * 100;
};

TEST_F(PageMesh, HasAllTrianglesAndTexelsIfTheyFit) {
  const Mesh mesh = shown(2'000'000);
  EXPECT_EQ(mesh.triangles.size(), triangles);
  EXPECT_EQ(mesh.texture.width, kTextureSize);
}

TEST_F(PageMesh, HasASmallerTextureIfTheFullOneDoesNotFit) {
  for (const std::size_t max_bytes : {500'000u, 200'000u}) {
    const Mesh mesh = shown(max_bytes);
    EXPECT_EQ(mesh.triangles.size(), triangles);
    EXPECT_LT(mesh.texture.width, kTextureSize);
    EXPECT_GT(mesh.texture.width, kTextureSize / 8);
    EXPECT_EQ(page_mesh(folder / "mesh.glb", max_bytes), read_bytes(folder / "shown.glb"));
  }
}

TEST_F(PageMesh, IsCoarseWithColorsIfTheTrianglesDoNotFit) {
  const Mesh mesh = shown(30'000);
  EXPECT_GT(mesh.triangles.size(), 1'000u);
  EXPECT_LT(mesh.triangles.size(), triangles / 2);
  EXPECT_EQ(mesh.colors.size(), mesh.positions.size());
}

TEST_F(PageMesh, IsEmptyIfNothingFits) { EXPECT_EQ(page_mesh(folder / "mesh.glb", 300), ""); }

TEST_F(PageMesh, RejectsFilesThatAreNotMeshes) {
  write_text(folder / "mesh.glb", "no mesh");
  EXPECT_NE(error_of([&] { (void)page_mesh(folder / "mesh.glb", 1'000'000); }).find("mesh.glb"), std::string::npos);
}

}  // namespace
}  // namespace cairn
