// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/file_name.hpp"
#include "cairn/eval/evaluation.hpp"
#include "cairn/mapping/mesh.hpp"
#include "geometry/axes.hpp"
#include "mesh/formats.hpp"
#include "mesh/gltf.hpp"
#include "mesh/tiles.hpp"
#include "support/files.hpp"
#include "support/meshes.hpp"

namespace cairn {
namespace {

Mesh tetrahedron() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0.5f}, {0, 2, 0}, {0, 0, 3}};
  for (const auto& p : mesh.positions) mesh.normals.push_back((p - Eigen::Vector3f(0.2f, 0.4f, 0.6f)).normalized());
  mesh.colors = {{0, 1, 2, 255}, {100, 150, 200, 255}, {255, 254, 128, 255}, {7, 77, 177, 255}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

/// Mesh with standard deviations, as of an adjusted map.
Mesh adjusted_tetrahedron() {
  Mesh mesh = tetrahedron();
  mesh.sigmas = {0.001f, 0.0021f, 0.0302f, 0.4f};
  return mesh;
}

class MeshFile : public testing::TestWithParam<const char*> {};

TEST_P(MeshFile, RoundTrips) {
  const TemporaryFolder folder;
  const auto file = folder / (std::string("a") + GetParam());
  const Mesh mesh = adjusted_tetrahedron();
  write_mesh(file, mesh);
  const Mesh read = read_mesh(file);
  EXPECT_EQ(read.triangles, mesh.triangles);
  EXPECT_EQ(read.colors, mesh.colors);
  EXPECT_EQ(read.sigmas, mesh.sigmas);
  ASSERT_EQ(read.positions.size(), mesh.positions.size());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    EXPECT_EQ(read.positions[i], mesh.positions[i]);
    EXPECT_TRUE(read.normals[i].isApprox(mesh.normals[i], 1e-6f));
  }
}

TEST_P(MeshFile, OmitsUnknownSigmas) {
  const TemporaryFolder folder;
  const auto file = folder / (std::string("a") + GetParam());
  write_mesh(file, tetrahedron());
  EXPECT_TRUE(read_mesh(file).sigmas.empty());
  for (const char* name : {"_SIGMA", "sigma"}) EXPECT_EQ(read_bytes(file).find(name), std::string::npos) << name;
}

TEST_P(MeshFile, SatisfiesTheGltfValidator) {
  if (extension_of(std::string("a") + GetParam()) == ".ply") return;
  const TemporaryFolder folder;
  for (const Mesh& mesh : {tetrahedron(), adjusted_tetrahedron(), Mesh{}}) {
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

TEST_P(MeshFile, IsNotWrittenToAMissingFolder) {
  const TemporaryFolder folder;
  EXPECT_NE(error_of([&] {
              write_mesh(folder / "no" / (std::string("a") + GetParam()), tetrahedron());
            }).find("cannot write"),
            std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(Formats, MeshFile, testing::Values(".glb", ".gltf", ".ply", ".GLB", ".Gltf", ".PLY"),
                         [](const auto& parameter) { return parameter.param + 1; });

/// A textured sheet, bent.
Mesh sheet() {
  Mesh mesh = grid_mesh(20, 10, 0.05f, [](float x, float y) { return Eigen::Vector3f(x - 1, y + 2, 0.2f * x * x); });
  for (const auto& p : mesh.positions) mesh.texture_coordinates.emplace_back(p.x() + 1, 2 * (p.y() - 2));
  mesh.texture = {32, 16, {}};
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x)
      mesh.texture.texels.push_back({static_cast<std::uint8_t>(8 * x), static_cast<std::uint8_t>(16 * y), 90});
  return mesh;
}

class Compressed : public testing::TestWithParam<std::tuple<Compression, const char*>> {};

TEST_P(Compressed, RoundTripsAndSatisfiesTheGltfValidator) {
  const auto [compression, extension] = GetParam();
  const TemporaryFolder folder;
  const auto file = folder / (std::string("a") + extension);
  GltfWriter writer({.compression = compression, .png = true, .source = "a test"});
  Mesh colored = sphere_mesh(3);
  for (const auto& p : colored.positions) {
    const auto c = static_cast<std::uint8_t>(128 + 100 * p.x());
    colored.colors.push_back({c, 200, c, 255});
    colored.sigmas.push_back(0.002f + 0.001f * p.x());
  }
  writer.add("sheet", sheet());
  writer.add("sphere", colored);
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
  ASSERT_EQ(parts[1].triangles.size(), colored.triangles.size());
  EXPECT_EQ(parts[0].texture.texels, sheet().texture.texels);
  // The grid: 2 m in at least 65536 steps, with a factor of two at most.
  const double step = compression == Compression::none ? 1e-7 : 2.0 * 2 / 65536;
  EXPECT_LT(evaluate_mesh(parts[0], sheet(), 2000).accuracy.max, step);
  for (std::size_t v = 0; v < parts[0].positions.size(); ++v) {
    const Eigen::Vector3f& p = parts[0].positions[v];
    EXPECT_LT((parts[0].texture_coordinates[v] - Eigen::Vector2f(p.x() + 1, 2 * (p.y() - 2))).norm(), 4e-4f);
  }
  for (std::size_t v = 0; v < parts[1].positions.size(); ++v) {
    EXPECT_LT((parts[1].normals[v] - parts[1].positions[v].normalized()).norm(), 0.02f);
    EXPECT_NEAR(parts[1].colors[v][0], 128 + 100 * static_cast<double>(parts[1].positions[v].x()), 2);
    const float sigma = 0.002f + 0.001f * parts[1].positions[v].x();
    EXPECT_NEAR(parts[1].sigmas[v], sigma,
                compression == Compression::none ? 1e-9 : 0.005 * static_cast<double>(sigma));
  }
  EXPECT_TRUE(parts[0].sigmas.empty());
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
  constexpr std::array kNames{"Plain", "Quantized", "Meshopt", "Draco"};
  return std::string(kNames[static_cast<std::size_t>(std::get<0>(parameter))]) + "_" + (std::get<1>(parameter) + 1);
}

INSTANTIATE_TEST_SUITE_P(All, Compressed,
                         testing::Combine(testing::Values(Compression::none, Compression::quantized,
                                                          Compression::meshopt, Compression::draco),
                                          testing::Values(".glb", ".gltf")),
                         [](const auto& it) { return name_of(it.param); });

TEST(Snap, LeavesNoTriangleWithoutArea) {
  // A sliver that becomes flat on a coarse grid.
  Mesh mesh = flat_grid(4, 4, 1.0f);
  mesh.positions.emplace_back(2.0f, 1e-6f, 0);
  mesh.normals.emplace_back(0, 0, 1);
  mesh.triangles.push_back({2, 25, 1});
  const Snapped snapped = snap(mesh);
  const MeshTopology topology = examine_topology(snapped.mesh);
  EXPECT_EQ(topology.degenerate_triangles + topology.unreferenced_vertices, 0u);
  EXPECT_EQ(snapped.mesh.triangles.size(), 32u);
}

/// Error message for a .glb of a triangle with modified JSON; all bytes of its coordinates are `byte`.
std::string error_of_glb(const std::function<void(nlohmann::json&)>& spoil, std::uint8_t byte = 0) {
  nlohmann::json j{{"asset", {{"version", "2.0"}}},
                   {"buffers", {{{"byteLength", 36}}}},
                   {"bufferViews", {{{"buffer", 0}, {"byteLength", 36}}}},
                   {"accessors", {{{"bufferView", 0}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}}}},
                   {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}}}},
                   {"nodes", {{{"mesh", 0}}}},
                   {"scenes", {{{"nodes", {0}}}}}};
  spoil(j);
  const TemporaryFolder folder;
  const auto glb = join_glb(j.dump(), std::vector<std::uint8_t>(36, byte));
  write_text(folder / "a.glb", {glb.begin(), glb.end()});
  try {
    (void)read_mesh(folder / "a.glb");
  } catch (const std::runtime_error& error) {
    return std::string(error.what()).substr((folder / "a.glb").string().size());
  }
  return "";
}

TEST(ReadGltf, RejectsAccessBeyondBuffers) {
  EXPECT_EQ(error_of_glb([](auto&) {}), "");
  const std::string beyond = ": an accessor reaches beyond its buffer";
  // stride * (count - 1) is a multiple of 2^64
  EXPECT_EQ(error_of_glb([](auto& j) {
              j["bufferViews"][0]["byteStride"] = 16;
              j["accessors"][0]["count"] = (1LL << 60) + 1;
            }),
            beyond);
  EXPECT_EQ(error_of_glb([](auto& j) { j["accessors"][0]["count"] = 4; }), beyond);
  EXPECT_EQ(error_of_glb([](auto& j) { j["accessors"][0]["byteOffset"] = 1; }), beyond);
  EXPECT_EQ(error_of_glb([](auto& j) { j["bufferViews"][0]["byteOffset"] = 4; }), ": a view reaches beyond its buffer");
  EXPECT_EQ(error_of_glb([](auto& j) { j["bufferViews"][0]["buffer"] = 7; }), ": there is no buffer 7");
  EXPECT_EQ(error_of_glb([](auto& j) { j["accessors"][0]["bufferView"] = 7; }), ": there is no view 7");
  // Doubles with a stride that is not a multiple of eight: tinygltf reports a stride of -1.
  EXPECT_EQ(error_of_glb([](auto& j) {
              j["bufferViews"][0]["byteStride"] = 12;
              j["accessors"][0]["componentType"] = 5130;
            }),
            ": an accessor has an unsupported type or stride");
}

TEST(ReadGltf, RejectsCyclicNodes) {
  EXPECT_EQ(error_of_glb([](auto& j) { j["nodes"][0]["children"] = {0}; }), ": node 0 appears twice");
  // Each node is twice a child of the previous node: 2^60 meshes.
  EXPECT_EQ(error_of_glb([](auto& j) {
              for (int i = 0; i < 60; ++i) {
                j["nodes"][i]["children"] = {i + 1, i + 1};
                j["nodes"][i + 1]["mesh"] = 0;
              }
            }),
            ": node 60 appears twice");
  const TemporaryFolder folder;
  write_text(folder / "a.gltf", R"({"extras": )" + std::string(100000, '['));
  EXPECT_NE(error_of([&] { (void)read_mesh(folder / "a.gltf"); }).find("its JSON is nested deeper than 64 levels"),
            std::string::npos);
}

TEST(ReadGltf, ReportsInvalidJson) {
  EXPECT_EQ(error_of_glb([](auto& j) {
              j["bufferViews"] = "none";
              j["extensionsUsed"] = {"EXT_meshopt_compression"};
            }),
            ": cannot be read as glTF: its JSON does not follow the glTF format");
  const TemporaryFolder folder;
  write_text(folder / "a.gltf", "{\"asset\": ");
  EXPECT_NE(error_of([&] { (void)read_mesh(folder / "a.gltf"); }).find("its JSON is malformed at byte 11"),
            std::string::npos);
}

TEST(ReadGltf, RejectsPositionsThatAreNotFinite) {
  EXPECT_EQ(error_of_glb([](auto&) {}, 0xff), ": vertex 0 has a coordinate that is not finite");
}

/// Error message for a .glb with a view declared as compressed by meshopt.
std::string error_of_meshopt(const std::string& mode, std::uint64_t count, std::uint64_t stride) {
  return error_of_glb([&](nlohmann::json& j) {
    j["extensionsUsed"] = {"EXT_meshopt_compression"};
    j["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = {
        {"buffer", 0}, {"byteLength", 36}, {"count", count}, {"byteStride", stride}, {"mode", mode}};
  });
}

TEST(ReadGltf, RejectsInvalidMeshoptViews) {
  const std::string prefix = ": cannot be read as glTF: a compressed view has ";
  EXPECT_EQ(error_of_meshopt("TRIANGLES", 3, 8), prefix + "a stride of 8, which TRIANGLES cannot have");
  EXPECT_EQ(error_of_meshopt("TRIANGLES", 3, 1), prefix + "a stride of 1, which TRIANGLES cannot have");
  EXPECT_EQ(error_of_meshopt("INDICES", 3, 3), prefix + "a stride of 3, which INDICES cannot have");
  EXPECT_EQ(error_of_meshopt("ATTRIBUTES", 3, 6), prefix + "a stride of 6, which ATTRIBUTES cannot have");
  EXPECT_EQ(error_of_meshopt("ATTRIBUTES", 3, 0), prefix + "a stride of 0, which ATTRIBUTES cannot have");
  EXPECT_EQ(error_of_meshopt("TRIANGLES", 4, 4), prefix + "4 elements, which its 36 bytes cannot hold");
  EXPECT_EQ(error_of_meshopt("ATTRIBUTES", 30000, 256), prefix + "30000 elements, which its 36 bytes cannot hold");
  EXPECT_EQ(error_of_meshopt("SOMETHING", 3, 4), prefix + "an unknown mode");
  EXPECT_EQ(error_of_meshopt("TRIANGLES", 3, 4), ": cannot be read as glTF: a compressed view is damaged");
}

std::string error_of_ply(const std::string& text) {
  const TemporaryFolder folder;
  write_text(folder / "a.ply", text);
  return error_of([&] { (void)read_mesh(folder / "a.ply"); }).substr((folder / "a.ply").string().size());
}

TEST(ReadPly, RejectsCountsBeyondTheFile) {
  const std::string ascii = "ply\nformat ascii 1.0\n", cut = ": the file is cut off or malformed",
                    place = "property float x\nproperty float y\nproperty float z\n",
                    face = "element face 1\nproperty list int int vertex_indices\nend_header\n";
  EXPECT_EQ(error_of_ply(ascii + "element vertex -1\n" + place + "end_header\n"), ": '-1' is not a number of elements");
  EXPECT_EQ(error_of_ply(ascii + "element vertex 18446744073709551615\n" + place + "end_header\n0 0 0\n"), cut);
  EXPECT_EQ(error_of_ply(ascii + "element camera 99999999999999\nend_header\n"),
            ": element 'camera' has no properties");
  EXPECT_EQ(error_of_ply(ascii + "element vertex 1\nproperty float x\nend_header\n0\n"),
            ": its vertices have no x, y and z");
  EXPECT_EQ(error_of_ply(ascii + face + "-1\n"), ": a face has an index or a length that is negative or too large");
  EXPECT_EQ(error_of_ply(ascii + face + "3 0 -1 2\n"),
            ": a face has an index or a length that is negative or too large");
  EXPECT_EQ(error_of_ply(ascii + face + "2000000000 1\n"), cut);
  EXPECT_EQ(error_of_ply("ply\nformat ascii 1.0\n" + face.substr(0, face.find("end_header"))),
            ": its header has no end_header: the file is cut off");
}

TEST(ReadPly, RefusesASecondListOfVertices) {
  const std::string place = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
  EXPECT_EQ(
      error_of_ply("ply\nformat ascii 1.0\n" + place + place +
                   "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n0 0 0\n0 0 0 1 2 3\n"),
      ": has more than one list of vertices");
}

TEST(ReadPly, ReadsLinesThatEndAsOnWindows) {
  const TemporaryFolder folder;
  write_text(folder / "a.ply",
             "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty float x\r\nproperty float y\r\nproperty float "
             "z\r\nproperty float red\r\nproperty float green\r\nproperty float blue\r\nelement face 1\r\nproperty "
             "list uchar int vertex_indices\r\nend_header\r\n0 0 0 300 -1 7\r\n1 0 0 0 0 0\r\n0 1 0 0 0 0\r\n3 0 1 2");
  const Mesh mesh = read_mesh(folder / "a.ply");
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.colors[0], (std::array<std::uint8_t, 4>{255, 0, 7, 255}));
}

TEST(WriteObj, WritesPositionsMaterialAndTexture) {
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

/// Six times the volume, positive if triangles are counter-clockwise seen from outside.
float volume_of(const std::vector<std::array<Eigen::Vector3f, 3>>& triangles) {
  float volume = 0;
  for (const auto& [a, b, c] : triangles) volume += a.dot(b.cross(c));
  return volume;
}

TEST(WriteStl, WritesTrianglesWithZUp) {
  const TemporaryFolder folder;
  const Mesh mesh = tetrahedron();
  write_mesh(folder / "a.STL", mesh);
  const std::string bytes = read_bytes(folder / "a.STL");
  ASSERT_EQ(bytes.size(), 84 + 50 * mesh.triangles.size());
  EXPECT_FALSE(bytes.starts_with("solid"));  // as text does
  const auto number = [&](std::size_t at) {
    float value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
  };
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, 4);
  EXPECT_EQ(count, mesh.triangles.size());
  std::vector<std::array<Eigen::Vector3f, 3>> plain, written;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto vector = [&](std::size_t i) {
      const std::size_t at = 84 + 50 * t + 12 * i;
      return Eigen::Vector3f(number(at), number(at + 4), number(at + 8));
    };
    written.push_back({vector(1), vector(2), vector(3)});
    const auto& [a, b, c] = written.back();
    EXPECT_TRUE(vector(0).isApprox((b - a).cross(c - a).normalized(), 1e-6f));
    auto& corners = plain.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3f& p = corners[i] = mesh.positions[mesh.triangles[t][i]];
      EXPECT_EQ(written.back()[i], Eigen::Vector3f(p.x(), p.z(), -p.y()));  // y is down in the world
    }
  }
  EXPECT_FLOAT_EQ(volume_of(written), volume_of(plain));  // rotated, not mirrored
}

TEST(WriteObj, IsUprightAndDeclaresItsAxes) {
  const TemporaryFolder folder;
  const Mesh mesh = tetrahedron();
  write_mesh(folder / "a.obj", mesh);
  const std::string obj = read_bytes(folder / "a.obj");
  EXPECT_TRUE(obj.starts_with("# cairn, metres, axes yup: x right, y up, z back\n")) << obj.substr(0, 80);
  EXPECT_NE(obj.find("\nv 0 -2 0 "), std::string::npos) << obj;  // y down was 2
  EXPECT_NE(obj.find("\nv 0 0 -3 "), std::string::npos) << obj;
}

TEST(Axes, RoundTripInEveryFormat) {
  const TemporaryFolder folder;
  const Mesh mesh = tetrahedron();
  for (const Axes axes : {Axes::automatic, Axes::world, Axes::y_up, Axes::z_up}) {
    write_ply(folder / "a.ply", mesh, axes);
    GltfWriter writer({.axes = axes, .file = {}});
    writer.add("map", mesh);
    writer.add_cameras({}, Trajectory(2), {Eigen::Isometry3d::Identity()});
    writer.write(folder / "a.glb");
    EXPECT_EQ(validate_gltf(folder / "a.glb"), "");
    for (const char* name : {"a.ply", "a.glb"}) {
      const Mesh read = read_mesh(folder / name);
      EXPECT_EQ(read.positions, mesh.positions) << name << " " << to_string(axes);
      for (std::size_t i = 0; i < mesh.normals.size(); ++i)
        EXPECT_TRUE(read.normals[i].isApprox(mesh.normals[i], 1e-6f)) << name << " " << to_string(axes);
    }
    EXPECT_NE(read_bytes(folder / "a.glb")
                  .find(axes == Axes::world  ? "\"up_axis\":\"-y\""
                        : axes == Axes::z_up ? "\"up_axis\":\"z\""
                                             : "\"up_axis\":\"y\""),
              std::string::npos);
    EXPECT_NE(read_bytes(folder / "a.ply")
                  .find("comment cairn, metres, axes " +
                        std::string(axes == Axes::automatic ? "world" : to_string(axes)) + ": x"),
              std::string::npos);
    // To the right, up and ahead of the camera, in the file's axes.
    const Eigen::Matrix3d turn = matrix_from_world(axes);
    EXPECT_DOUBLE_EQ(turn.determinant(), 1);
    EXPECT_EQ(turn * Eigen::Vector3d(1, -2, 3), axes == Axes::y_up   ? Eigen::Vector3d(1, 2, -3)
                                                : axes == Axes::z_up ? Eigen::Vector3d(1, 3, 2)
                                                                     : Eigen::Vector3d(1, -2, 3));
  }
}

TEST(WriteMesh, NamesFilesBesideAGltfAsUris) {
  const TemporaryFolder folder;
  for (const char* name : {"room #2.gltf", "100%.gltf", "r\xc3\xa4ume & co.gltf"}) {
    write_mesh(folder / name, sheet());
    EXPECT_EQ(validate_gltf(folder / name), "") << name;
    EXPECT_EQ(read_mesh(folder / name).triangles, sheet().triangles) << name;
  }
  const std::string json = read_bytes(folder / "room #2.gltf");
  EXPECT_NE(json.find("\"room%20%232.bin\""), std::string::npos);
  EXPECT_NE(json.find("\"room%20%232-0.jpg\""), std::string::npos);
}

TEST(Tileset, IsPlacedOnTheEarthByItsCoordinates) {
  const Eigen::Isometry3d at = earth_from_tileset({.latitude = 47.4211, .longitude = 10.9863, .height = 2962});
  const Eigen::Vector3d up = at.linear().col(2);
  EXPECT_NEAR(std::asin(up.z()) * 180 / std::numbers::pi, 47.4211, 1e-9);
  EXPECT_NEAR(std::atan2(at.translation().y(), at.translation().x()) * 180 / std::numbers::pi, 10.9863, 1e-9);
  EXPECT_DOUBLE_EQ(at.linear().determinant(), 1);
  EXPECT_NEAR(at.linear().col(1).dot(Eigen::Vector3d::UnitZ()), std::cos(47.4211 * std::numbers::pi / 180), 1e-12);
  // A heading of 90 degrees points east; on the equator at longitude 0 this is +y.
  const Eigen::Isometry3d equator = earth_from_tileset({.heading = 90});
  EXPECT_TRUE(equator.translation().isApprox(Eigen::Vector3d(6378137, 0, 0), 1e-12));
  EXPECT_TRUE(equator.linear().col(1).isApprox(Eigen::Vector3d::UnitY(), 1e-12));
  EXPECT_TRUE(equator.linear().col(2).isApprox(Eigen::Vector3d::UnitX(), 1e-12));
  const Eigen::Isometry3d pole = earth_from_tileset({.latitude = 90, .height = 10});
  EXPECT_NEAR(pole.translation().z(), 6356752.314245 + 10, 1e-6);  // WGS 84's smaller radius
  const TemporaryFolder folder;
  write_tileset(folder / "tileset.json", {}, GeoPlace{.heading = 90});
  const auto json = nlohmann::json::parse(read_bytes(folder / "tileset.json"));
  EXPECT_EQ(json["root"]["transform"].size(), 16u);
  EXPECT_EQ(json["root"]["transform"][12], 6378137.0);
}

TEST(WriteMesh, RefusesAnUnknownExtension) {
  EXPECT_NE(error_of([] { write_mesh("a.fbx", tetrahedron()); }).find("'.fbx'"), std::string::npos);
  EXPECT_NE(error_of([] { (void)read_mesh("a.stl"); }).find("is not a supported mesh format"), std::string::npos);
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
