// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include "cairn/mesh.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

Mesh tetrahedron() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0.5f}, {0, 2, 0}, {0, 0, 3}};
  for (const auto& p : mesh.positions) mesh.normals.push_back((p - Eigen::Vector3f(0.2f, 0.4f, 0.6f)).normalized());
  mesh.colours = {{0, 1, 2, 255}, {100, 150, 200, 255}, {255, 254, 128, 255}, {7, 77, 177, 255}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

class MeshFile : public testing::TestWithParam<const char*> {};

TEST_P(MeshFile, ComesBackAsItWasWritten) {
  const TemporaryFolder folder;
  const auto file = folder / (std::string("a") + GetParam());
  const Mesh mesh = tetrahedron();
  write_mesh(file, mesh);
  const Mesh read = read_mesh(file);
  EXPECT_EQ(read.triangles, mesh.triangles);
  EXPECT_EQ(read.colours, mesh.colours);
  ASSERT_EQ(read.positions.size(), mesh.positions.size());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    EXPECT_EQ(read.positions[i], mesh.positions[i]);
    EXPECT_TRUE(read.normals[i].isApprox(mesh.normals[i], 1e-6f));
  }
}

TEST_P(MeshFile, SatisfiesTheGltfValidator) {
  if (std::string(GetParam()) == ".ply") return;
  const TemporaryFolder folder;
  for (const Mesh& mesh : {tetrahedron(), Mesh{}}) {
    const auto file = folder / (std::string("a") + GetParam());
    write_mesh(file, mesh);
    EXPECT_EQ(validate_gltf(file), "");
  }
}

TEST_P(MeshFile, RefusesAFileThatIsCutOff) {
  const TemporaryFolder folder;
  const auto file = folder / (std::string("a") + GetParam());
  write_mesh(file, tetrahedron());
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  EXPECT_NE(error_of([&] { (void)read_mesh(file); }).find("a."), std::string::npos);
}

TEST_P(MeshFile, IsNotLeftBehindInAFolderThatIsMissing) {
  const TemporaryFolder folder;
  EXPECT_NE(error_of([&] {
              write_mesh(folder / "no" / (std::string("a") + GetParam()), tetrahedron());
            }).find("cannot write"),
            std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(Formats, MeshFile, testing::Values(".glb", ".gltf", ".ply"),
                         [](const auto& parameter) { return parameter.param + 1; });

TEST(WriteMesh, RefusesAnUnknownExtension) {
  EXPECT_NE(error_of([] { write_mesh("a.stl", tetrahedron()); }).find("'.stl'"), std::string::npos);
}

TEST(WriteMesh, TurnsGltfToYUp) {
  const TemporaryFolder folder;
  write_mesh(folder / "a.gltf", tetrahedron());
  const std::string json = read_bytes(folder / "a.gltf");
  EXPECT_NE(json.find("up_axis"), std::string::npos);
  // y from 0 to 2 downwards is -2 to 0 upwards
  const std::string bin = read_bytes(folder / "a.bin");
  float y = 0;
  std::memcpy(&y, bin.data() + 2 * 12 + 4, 4);
  EXPECT_EQ(y, -2.0f);
}

}  // namespace
}  // namespace cairn
