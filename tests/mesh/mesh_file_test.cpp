// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include "cairn/evaluation.hpp"
#include "cairn/mesh.hpp"
#include "mesh/gltf.hpp"
#include "support/files.hpp"
#include "support/meshes.hpp"

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

/// A textured sheet, bent.
Mesh sheet() {
  Mesh mesh = grid_mesh(20, 10, 0.05f, [](float x, float y) { return Eigen::Vector3f(x - 1, y + 2, 0.2f * x * x); });
  for (const auto& p : mesh.positions) mesh.texture_places.emplace_back(p.x() + 1, 2 * (p.y() - 2));
  mesh.texture = {32, 16, {}};
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x)
      mesh.texture.texels.push_back({static_cast<std::uint8_t>(8 * x), static_cast<std::uint8_t>(16 * y), 90});
  return mesh;
}

class Compressed : public testing::TestWithParam<std::tuple<Compression, const char*>> {};

TEST_P(Compressed, ComesBackAndSatisfiesTheGltfValidator) {
  const auto [compression, extension] = GetParam();
  const TemporaryFolder folder;
  const auto file = folder / (std::string("a") + extension);
  GltfWriter writer({.compression = compression, .png = true, .source = "a test"});
  Mesh coloured = sphere_mesh(3);
  for (const auto& p : coloured.positions) {
    const auto c = static_cast<std::uint8_t>(128 + 100 * p.x());
    coloured.colours.push_back({c, 200, c, 255});
  }
  writer.add("sheet", sheet());
  writer.add("sphere", coloured);
  writer.add("nothing", Mesh{});
  Trajectory path(3);
  for (int i = 0; i < 3; ++i) path[static_cast<std::size_t>(i)].world_from_camera.translation().x() = i;
  Eigen::Isometry3d eye = Eigen::Isometry3d::Identity();
  eye.linear() = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()).toRotationMatrix();
  writer.add_cameras({}, path, {eye, Eigen::Isometry3d::Identity()});
  writer.write(file);
  EXPECT_EQ(validate_gltf(file), "");

  const std::vector<Mesh> parts = read_mesh_parts(file);
  ASSERT_EQ(parts.size(), 2u);
  ASSERT_EQ(parts[0].triangles.size(), sheet().triangles.size());
  ASSERT_EQ(parts[1].triangles.size(), coloured.triangles.size());
  EXPECT_EQ(parts[0].texture.texels, sheet().texture.texels);
  // The grid: 2 m in 65536 steps at least, of two sizes at most.
  const double step = compression == Compression::none ? 1e-7 : 2.0 * 2 / 65536;
  EXPECT_LT(evaluate_mesh(parts[0], sheet(), 2000).accuracy.max, step);
  for (std::size_t v = 0; v < parts[0].positions.size(); ++v) {
    const Eigen::Vector3f& p = parts[0].positions[v];
    EXPECT_LT((parts[0].texture_places[v] - Eigen::Vector2f(p.x() + 1, 2 * (p.y() - 2))).norm(), 4e-4f);
  }
  for (std::size_t v = 0; v < parts[1].positions.size(); ++v) {
    EXPECT_LT((parts[1].normals[v] - parts[1].positions[v].normalized()).norm(), 0.02f);
    EXPECT_NEAR(parts[1].colours[v][0], 128 + 100 * static_cast<double>(parts[1].positions[v].x()), 2);
  }
  for (const Mesh& part : parts) {
    const MeshTopology topology = examine_topology(part);
    EXPECT_EQ(topology.non_manifold_edges + topology.degenerate_triangles + topology.unreferenced_vertices, 0u);
  }
}

TEST_P(Compressed, IsRefusedWhenCutOff) {
  const auto [compression, extension] = GetParam();
  const TemporaryFolder folder;
  const auto file = folder / (std::string("a") + extension);
  GltfWriter writer({.compression = compression});
  writer.add("sphere", sphere_mesh(3));
  writer.write(file);
  std::filesystem::resize_file(file, std::filesystem::file_size(file) * 2 / 3);
  EXPECT_NE(error_of([&] { (void)read_mesh(file); }).find("a."), std::string::npos);
}

std::string name_of(const std::tuple<Compression, const char*>& parameter) {
  constexpr std::array kNames{"Plain", "Quantised", "Meshopt", "Draco"};
  return std::string(kNames[static_cast<std::size_t>(std::get<0>(parameter))]) + "_" + (std::get<1>(parameter) + 1);
}

INSTANTIATE_TEST_SUITE_P(All, Compressed,
                         testing::Combine(testing::Values(Compression::none, Compression::quantised,
                                                          Compression::meshopt, Compression::draco),
                                          testing::Values(".glb", ".gltf")),
                         [](const auto& it) { return name_of(it.param); });

TEST(Snap, LeavesNoTriangleWithoutArea) {
  // A sliver that a coarse grid makes flat.
  Mesh mesh = flat_grid(4, 4, 1.0f);
  mesh.positions.emplace_back(2.0f, 1e-6f, 0);
  mesh.normals.emplace_back(0, 0, 1);
  mesh.triangles.push_back({2, 25, 1});
  const Snapped snapped = snap(mesh);
  const MeshTopology topology = examine_topology(snapped.mesh);
  EXPECT_EQ(topology.degenerate_triangles + topology.unreferenced_vertices, 0u);
  EXPECT_EQ(snapped.mesh.triangles.size(), 32u);
}

TEST(WriteObj, TellsPlacesMaterialAndTexture) {
  const TemporaryFolder folder;
  write_mesh(folder / "a.obj", sheet());
  const std::string obj = read_bytes(folder / "a.obj"), mtl = read_bytes(folder / "a.mtl");
  EXPECT_NE(obj.find("mtllib a.mtl"), std::string::npos);
  EXPECT_NE(obj.find("usemtl surface-0"), std::string::npos);
  EXPECT_NE(mtl.find("map_Kd a-0.jpg"), std::string::npos);
  EXPECT_EQ(read_bytes(folder / "a-0.jpg").substr(0, 2), "\xff\xd8");
  EXPECT_NE(obj.find("\nvt 0.000000 1.000000\n"), std::string::npos);  // OBJ counts from below
  EXPECT_NE(obj.find("\nf 1/1/1 2/2/2 23/23/23\n"), std::string::npos);
}

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
