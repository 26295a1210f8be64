// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// `cairn export`, and the output of reconstruct with the same options.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <sstream>

#include "cairn/eval/evaluation.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/map.hpp"
#include "mesh/topology.hpp"
#include "shaders/voxel.h"
#include "support/files.hpp"
#include "support/shared.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Scan of the room and its map.
class Export : public testing::Test {
 protected:
  /// Path in the recording, in its map, or in a map with given poses, which has no session. All are shared.
  static std::string path(const std::string& name) {
    const fs::path room = shared_recording({"room", "--frames", "60"});
    const auto in = [&](const std::string& folder) { return name == folder || name.starts_with(folder + "/"); };
    const auto of = [&](const fs::path& folder) {
      const auto slash = name.find('/');
      return slash == name.npos ? folder.string() : folder.string() + name.substr(slash);
    };
    if (in("map")) return of(shared_map(room, {"--voxel-size", "0.02"}));
    if (in("given"))
      return of(shared_map(
          room, {"--voxel-size", "0.02", "--frames", "0:20", "--poses", (room / "groundtruth.txt").string()}));
    return of(room);
  }
  [[nodiscard]] std::string to(const std::string& name) const { return (out / name).string(); }
  /// Exports the map and returns the output of --json.
  Json exported(const std::string& name, std::vector<std::string> options = {}) const {
    std::vector<std::string> arguments{"export", path("map"), "-o", to(name), "--json"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const Ran ran = run_cairn(arguments);
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return ran.exit_code == 0 ? Json::parse(ran.out) : Json{};
  }
  void expect_refused(std::vector<std::string> options, const std::string& what, const std::string& file = "x.glb",
                      const std::string& map = "map") const {
    std::vector<std::string> arguments{"export", path(map), "-o", to(file)};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const Ran ran = run_cairn(arguments);
    expect_last_line(ran, what.find("number expected") == what.npos ? 1 : 2, what);
    EXPECT_TRUE(fs::is_empty(out.path())) << "something was left behind";
  }
  TemporaryFolder out;
};

/// `is_whole`: the parts form a complete map with matching cells. Two triangle fans that touch in one part may be
/// connected by another part.
void expect_sound(const std::vector<Mesh>& parts, bool is_complete = false) {
  for (const Mesh& part : parts) {
    const MeshTopology topology = examine_topology(part);
    EXPECT_EQ(topology.non_manifold_edges, 0u);
    EXPECT_EQ(topology.coincident_triangles, 0u);
    EXPECT_EQ(topology.degenerate_triangles, 0u);
    EXPECT_EQ(topology.unreferenced_vertices, 0u);
  }
  if (!is_complete) return;
  const MeshTopology complete = examine_topology(joined(parts));
  EXPECT_EQ(complete.non_manifold_edges, 0u);
  EXPECT_EQ(complete.non_manifold_vertices, 0u);
  EXPECT_EQ(complete.coincident_triangles, 0u);
}

TEST_F(Export, WritesEveryFormatSoundAndValid) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> kinds{
      {"plain.glb", {"--no-texture"}},
      {"simple.glb", {"--simplify", "0.1", "--cameras", "--no-texture"}},
      {"bounded.gltf", {"--max-error", "0.004", "--fill-holes", "0.2", "--no-texture"}},
      {"quantized.glb", {"--simplify", "0.1", "--compress", "quantized", "--no-texture"}},
      {"meshopt.glb", {"--simplify", "0.1", "--compress", "meshopt", "--texture"}},
      {"meshopt.gltf", {"--simplify", "0.1", "--compress", "meshopt", "--texture", "--texture-format", "png"}},
      {"draco.glb", {"--simplify", "0.1", "--compress", "draco", "--texture", "--texture-size", "512"}},
      {"cells.glb", {"--simplify", "0.2", "--cell-size", "1.5", "--texture"}},
      {"plain.ply", {"--simplify", "0.5"}}};
  for (const auto& [name, options] : kinds) {
    SCOPED_TRACE(name);
    const Json report = exported(name, options);
    if (!name.ends_with(".ply")) {
      EXPECT_EQ(validate_gltf(to(name)), "");
    }
    const std::vector<Mesh> parts = read_mesh_parts(to(name));
    expect_sound(parts, true);
    std::size_t triangles = 0;
    for (const Mesh& part : parts) triangles += part.triangles.size();
    EXPECT_NEAR(static_cast<double>(triangles), report.at("triangles").get<double>(),
                0.002 * static_cast<double>(triangles));
    if (name == "simple.glb") {
      EXPECT_NEAR(static_cast<double>(triangles), 0.1 * report.at("full_triangles").get<double>(), 500);
    } else if (name == "cells.glb") {
      EXPECT_GT(parts.size(), 4u);
    } else if (name == "draco.glb") {
      EXPECT_LE(std::max(parts[0].texture.width, parts[0].texture.height), 512);
    }
  }
}

TEST_F(Export, TexturesReproduceTheSceneBetweenKeyframes) {
  // Frames between keyframes, against noise-free images.
  exported("textured.glb", {"--simplify", "0.1", "--texture"});
  exported("colored.glb", {"--simplify", "0.1", "--no-texture"});
  const Trajectory truth = read_trajectory(path("room/groundtruth.txt"));
  const Eigen::Isometry3d move = estimate_from_truth(read_trajectory(path("map/trajectory.txt")), truth);
  const auto psnr = [&](const char* name) {
    const auto recording = with_poses(open_source(path("room")), truth);
    return evaluate_views(read_mesh_parts(to(name)), *recording, move, 7);
  };
  const ViewError textured = psnr("textured.glb"), colored = psnr("colored.glb");
  EXPECT_GT(textured.covered, 0.97);
  EXPECT_GT(textured.psnr, 28);
  EXPECT_GT(textured.psnr, colored.psnr + 6) << colored.psnr;
}

TEST_F(Export, IsDeterministicAndDoesNotChangeTheMap) {
  const auto listing = [&] {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::directory_iterator(path("map/session")))
      if (entry.is_regular_file()) files[entry.path().filename().string()] = read_bytes(entry.path());
    return files;
  };
  const auto before = listing();
  for (const char* name : {"a.glb", "b.glb"})
    exported(name, {"--simplify", "0.1", "--texture", "--compress", "meshopt"});
  EXPECT_EQ(read_bytes(out / "a.glb"), read_bytes(out / "b.glb"));
  EXPECT_TRUE(listing() == before);
}

TEST_F(Export, EqualsReconstructWithTheSameOptions) {
  ASSERT_EQ(run_cairn({"reconstruct", path("room"), "-o", to("again"), "--voxel-size", "0.02", "--quality", "fast",
                       "--simplify", "0.1", "--texture", "--compress", "quantized"})
                .exit_code,
            0);
  exported("a.glb", {"--simplify", "0.1", "--texture", "--compress", "quantized"});
  const std::vector<Mesh> a = read_mesh_parts(out / "again" / "mesh.glb"), b = read_mesh_parts(to("a.glb"));
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(a[0].positions, b[0].positions);
  EXPECT_EQ(a[0].triangles, b[0].triangles);
  EXPECT_EQ(a[0].texture.texels, b[0].texture.texels);
}

TEST_F(Export, SimplifiesWithoutNewHoles) {
  exported("full.ply");
  exported("simple.ply", {"--simplify", "0.1"});
  const Mesh full = read_mesh(to("full.ply")), simple = read_mesh(to("simple.ply"));
  const MeshError error = evaluate_mesh(simple, full, 50000);
  EXPECT_LT(error.accuracy.mean, 0.002);
  EXPECT_LT(error.completeness.mean, 0.002);
  EXPECT_LT(error.completeness.max, 0.05);  // a hole would be farther from the remaining surface
  EXPECT_LE(examine_topology(simple).borders, examine_topology(full).borders);
}

TEST_F(Export, CellsFitTogetherWithoutCracks) {
  exported("whole.ply", {"--simplify", "0.2"});
  exported("cells.ply", {"--simplify", "0.2", "--cell-size", "1.2"});
  const double complete = examine_topology(read_mesh(to("whole.ply"))).border_length,
               cells = examine_topology(read_mesh(to("cells.ply"))).border_length;
  EXPECT_NEAR(cells, complete, 0.03 * complete);
}

TEST_F(Export, WritesTilesWithLevelsOfDetail) {
  const Json report =
      exported("tileset.json", {"--simplify", "0.3", "--cell-size", "1.3", "--compress", "meshopt", "--texture"});
  const Json tileset = Json::parse(read_bytes(out / "tileset.json"));
  EXPECT_EQ(tileset.at("asset").at("version"), "1.1");
  int tiles = 0, leaves = 0;
  const std::function<void(const Json&, double)> visit = [&](const Json& tile, double parent_error) {
    const double error = tile.at("geometricError");
    EXPECT_LE(error, parent_error);
    if (tile.contains("content")) {
      ++tiles;
      const fs::path file = out / tile.at("content").at("uri").get<std::string>();
      EXPECT_EQ(validate_gltf(file), "");
      const std::vector<Mesh> parts = read_mesh_parts(file);
      expect_sound(parts);
      // The box is z-up: x, z and -y of the world.
      const auto box = tile.at("boundingVolume").at("box").get<std::vector<double>>();
      for (const auto& p : parts.at(0).positions)
        for (const auto& [at, middle, half] :
             {std::tuple(p.x(), box[0], box[3]), {p.z(), box[1], box[7]}, {-p.y(), box[2], box[11]}})
          ASSERT_LE(std::abs(static_cast<double>(at) - middle), half + 1e-3);
    }
    if (!tile.contains("children")) {
      ++leaves;
      EXPECT_EQ(error, 0);
      return;
    }
    for (const Json& child : tile.at("children")) visit(child, error);
  };
  visit(tileset.at("root"), tileset.at("geometricError").get<double>() + 1e-9);
  EXPECT_EQ(tiles, report.at("tiles").get<int>());
  EXPECT_GT(leaves, 6);
  EXPECT_GT(tiles, leaves);
}

TEST_F(Export, TilesetsOfOneFolderKeepTheirTiles) {
  const auto tiles_of = [&](const std::string& name) {
    std::vector<std::string> tiles;
    const std::function<void(const Json&)> visit = [&](const Json& tile) {
      if (tile.contains("content")) tiles.push_back(tile.at("content").at("uri"));
      if (tile.contains("children"))
        for (const Json& child : tile.at("children")) visit(child);
    };
    visit(Json::parse(read_bytes(out / name)).at("root"));
    return tiles;
  };
  const std::vector<std::string> options{"--simplify", "0.3", "--cell-size", "1.3", "--no-texture"},
      others{"--triangles", "2000", "--no-texture"};
  exported("a.json", options);
  const auto before = bytes_below(out.path());
  exported("b.JSON", others);
  const auto after = bytes_below(out.path());
  for (const auto& [file, bytes] : before) EXPECT_TRUE(after.contains(file) && after.at(file) == bytes) << file;
  for (const auto& [name, folder] : {std::pair("a.json", "a.tiles/"), {"b.JSON", "b.tiles/"}})
    for (const std::string& tile : tiles_of(name)) {
      EXPECT_TRUE(tile.starts_with(folder)) << tile;
      EXPECT_FALSE(read_mesh(out / tile).triangles.empty()) << tile;
    }

  // A failed repetition of the export keeps the previous tileset; a successful repetition removes it completely.
  const auto both = bytes_below(out.path());
  std::vector<std::string> again{"export", path("map"), "-o", to("a.json")};
  again.insert(again.end(), others.begin(), others.end());
  const Ran failed = run_cairn(again, with_files_of(10 << 10));
  expect_last_line(failed, 1, "File too large");
  EXPECT_TRUE(bytes_below(out.path()) == both);
  ASSERT_EQ(run_cairn(again).exit_code, 0);
  EXPECT_EQ(std::distance(fs::directory_iterator(out / "a.tiles"), fs::directory_iterator()), 1);
  exported("a.json", options);
  EXPECT_TRUE(bytes_below(out.path()) == both);

  exported("a \xc3\xa9.json", others);
  for (const std::string& tile : tiles_of("a \xc3\xa9.json"))
    EXPECT_TRUE(tile.starts_with("a%20%C3%A9.tiles/")) << tile;
}

TEST_F(Export, LeavesAtMostTheRequestedTriangles) {
  using Options = std::vector<std::string>;
  for (const auto& [name, count, options] : {std::tuple("x.glb", 50000, Options{"--texture"}),
                                             {"x.glb", 50000, Options{"--no-texture"}},
                                             {"x.ply", 3000, Options{}},
                                             {"x.glb", 3000, Options{"--texture", "--compress", "meshopt"}},
                                             {"x.glb", 20000, Options{"--no-texture", "--cell-size", "1.5"}},
                                             {"x.glb", 400, Options{"--no-texture", "--cell-size", "1.5"}},
                                             {"x.stl", 100, Options{}}}) {
    SCOPED_TRACE(std::string(name) + " " + std::to_string(count));
    Options all{"--triangles", std::to_string(count)};
    all.insert(all.end(), options.begin(), options.end());
    const Json report = exported(name, all);
    EXPECT_LE(report.at("triangles").get<int>(), count);
    EXPECT_GE(report.at("triangles").get<int>(), count >= 3000 ? count * 9 / 10 : count / 4);
    if (std::string(name) == "x.stl") continue;
    std::size_t triangles = 0;
    const std::vector<Mesh> parts = read_mesh_parts(to(name));
    for (const Mesh& part : parts) triangles += part.triangles.size();
    EXPECT_LE(triangles, static_cast<std::size_t>(count));
    expect_sound(parts);
  }
  exported("x.ply");
  exported("y.ply", {"--triangles", "100000000"});  // more than there are
  EXPECT_EQ(read_bytes(to("x.ply")) == read_bytes(to("y.ply")), true);
  for (const char* name : {"x.ply", "y.ply", "x.glb", "x.stl"}) fs::remove(to(name));
  expect_refused({"--triangles", "7"}, "--triangles 7: whole number expected, 100 to");
}

TEST_F(Export, WritesStlWithZUp) {
  exported("x.ply");
  const Json report = exported("X.STL");
  const std::string bytes = read_bytes(to("X.STL"));
  ASSERT_EQ(bytes.size(), 84 + 50 * report.at("triangles").get<std::size_t>());
  Eigen::AlignedBox3f stl, ply;
  for (std::size_t at = 84; at < bytes.size(); at += 50)
    for (std::size_t corner = 1; corner < 4; ++corner) {
      Eigen::Vector3f p;
      std::memcpy(p.data(), bytes.data() + at + 12 * corner, 12);
      stl.extend(p);
    }
  for (const auto& p : read_mesh(to("x.ply")).positions) ply.extend(Eigen::Vector3f(p.x(), p.z(), -p.y()));
  EXPECT_EQ(stl.min(), ply.min());
  EXPECT_EQ(stl.max(), ply.max());
}

/// Numbers that an independent reader of tests/support prints about a file.
std::vector<double> numbers_by(const std::string& script, const std::string& file) {
  const TemporaryFolder folder;
  const std::string printed = (folder / "numbers.txt").string();
  const std::string support = (source_folder() / "tests/support").string();
  EXPECT_EQ(std::system(fmt::format("node '{}/{}' '{}' >'{}' 2>&1", support, script, file, printed).c_str()), 0)
      << read_bytes(printed);
  std::istringstream in(read_bytes(printed));
  std::vector<double> numbers;
  for (double number = 0; in >> number;) numbers.push_back(number);
  return numbers;
}

TEST_F(Export, WritesPointsAsLas) {
  exported("x.ply", {"--points", "0.05"});
  const Json report = exported("x.las", {"--points", "0.05"});
  const Mesh ply = read_mesh(to("x.ply"));
  const std::vector<double> las = numbers_by("read_las.mjs", to("x.las"));
  ASSERT_EQ(las.size(), 10u);
  EXPECT_EQ(las[0], static_cast<double>(ply.positions.size()));
  EXPECT_EQ(report.at("points"), ply.positions.size());
  Eigen::AlignedBox3d box;  // z up
  Eigen::Vector3d color = Eigen::Vector3d::Zero();
  for (const auto& p : ply.positions) box.extend(Eigen::Vector3d(p.x(), p.z(), -p.y()));
  for (const auto& c : ply.colors) color += Eigen::Vector3d(c[0], c[1], c[2]) / static_cast<double>(ply.colors.size());
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(las[static_cast<std::size_t>(1 + i)], box.min()[i], 1e-3);
    EXPECT_NEAR(las[static_cast<std::size_t>(4 + i)], box.sizes()[i], 1e-3);
    EXPECT_NEAR(las[static_cast<std::size_t>(7 + i)], color[i], 1);
  }
  const std::string first = read_bytes(to("x.las"));
  exported("x.las", {"--points", "0.05"});
  EXPECT_TRUE(first == read_bytes(to("x.las")));
}

TEST_F(Export, WritesTexturesAsUsdz) {
  for (const bool textured : {true, false}) {
    const std::string ply = textured ? "a.ply" : "b.ply", usdz = textured ? "a.usdz" : "b.usdz";
    exported(ply, {"--simplify", "0.2"});
    std::vector<std::string> arguments{"--simplify", "0.2"};
    if (!textured) arguments.push_back("--no-texture");
    const Json report = exported(usdz, arguments);
    const std::vector<double> read = numbers_by("read_usdz.mjs", to(usdz));
    ASSERT_EQ(read.size(), 9u);
    EXPECT_EQ(read[1], report.at("triangles"));
    EXPECT_EQ(read[8] != 0, textured);
    Eigen::AlignedBox3d box;  // y up
    for (const auto& p : read_mesh(to(ply)).positions)
      box.extend(Eigen::Vector3d(p.cast<double>().cwiseProduct(Eigen::Vector3f(1, -1, -1).cast<double>())));
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(read[static_cast<std::size_t>(2 + i)], box.min()[i], 1e-3);
      EXPECT_NEAR(read[static_cast<std::size_t>(5 + i)], box.sizes()[i], 1e-3);
    }
  }
}

TEST_F(Export, RecognizesExtensionsInAnyCase) {
  exported("X.GLB", {"--simplify", "0.2", "--compress", "meshopt"});
  EXPECT_EQ(validate_gltf(to("X.GLB")), "");
  EXPECT_GT(read_mesh_parts(to("X.GLB")).at(0).texture.width, 0);
  exported("x.Ply", {"--points", "0.1"});
  EXPECT_GT(read_mesh(to("x.Ply")).positions.size(), 100u);
  exported("X.OBJ", {"--simplify", "0.2"});
  EXPECT_TRUE(fs::exists(to("X.mtl")));
  ASSERT_EQ(run_cairn({"export", path("map"), "-o", to("X.VDB")}).exit_code, 0);
  EXPECT_EQ(read_bytes(to("X.VDB")) == read_bytes(path("map/map.vdb")), true);
}

TEST_F(Export, PrintsTheSizeOfEachFile) {
  const Ran ran = run_cairn({"export", path("map"), "-o", to("x.obj"), "--simplify", "0.2", "--texture"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  int files = 0;
  for (const auto& entry : fs::directory_iterator(out.path())) {
    ++files;
    std::istringstream lines(ran.out);
    bool is_listed = false;
    for (std::string line; std::getline(lines, line);) {
      if (!line.starts_with(entry.path().string() + "  ")) continue;
      is_listed = true;
      std::istringstream words(line.substr(entry.path().string().size()));
      double size = 0;
      std::string unit;
      words >> size >> unit;
      size *= unit.starts_with("MB") ? 1e6 : unit.starts_with("kB") ? 1e3 : 1;
      EXPECT_NEAR(size, static_cast<double>(entry.file_size()), 0.05 * static_cast<double>(entry.file_size())) << line;
    }
    EXPECT_TRUE(is_listed) << entry.path() << ran.out;
  }
  EXPECT_EQ(files, 3);
  const Json report = exported("tileset.json", {"--triangles", "5000", "--no-texture"});
  const fs::path folder = fs::path(report.at("files").back().at("file")).parent_path();
  EXPECT_EQ(report.at("files").size(), 1 + report.at("tiles").get<std::size_t>());
  for (const Json& file : report.at("files"))
    EXPECT_EQ(file.at("bytes"), fs::file_size(file.at("file").get<std::string>()));
}

TEST_F(Export, ReportsItsProgress) {
  // For a map in one cell each stage is a step: three without a texture, plus the keyframes with a texture.
  constexpr double kPlain = 0.7, kTextured = 0.5;
  Map map = Map::open(path("map"));
  ExportOptions textured{.texture = {.enabled = true}}, levels = textured, cells = textured;
  levels.levels = 3;
  cells.cell_size = 1.5f;
  for (const auto& [name, options, max_step] : {std::tuple("plain.glb", ExportOptions{}, kPlain),
                                                {"points.ply", {.point_spacing = 0.05f}, kPlain},
                                                {"textured.glb", textured, kTextured},
                                                {"levels.glb", levels, kTextured},
                                                {"cells.glb", cells, 0.25},
                                                {"tileset.json", textured, kTextured}}) {
    SCOPED_TRACE(name);
    std::vector<double> shares;
    map.export_mesh(out / name, options, [&](int done, int count, const std::string& next) {
      EXPECT_FALSE(next.empty());
      shares.push_back(static_cast<double>(done) / count);
    });
    ASSERT_GE(shares.size(), 4u);
    EXPECT_EQ(shares.front(), 0);
    EXPECT_EQ(shares.back(), 1);
    for (std::size_t i = 1; i < shares.size(); ++i) {
      EXPECT_GE(shares[i], shares[i - 1]) << i;
      EXPECT_LE(shares[i] - shares[i - 1], max_step) << i << " of " << shares.size();
    }
    EXPECT_GT(shares[shares.size() - 2], 0.9);  // the last step is a small part
  }
}

TEST_F(Export, WritesPointsAndLevels) {
  const Json report = exported("points.ply", {"--points", "0.05"});
  const Mesh points = read_mesh(to("points.ply"));
  EXPECT_TRUE(points.triangles.empty());
  EXPECT_EQ(points.positions.size(), report.at("points").get<std::size_t>());
  EXPECT_EQ(points.positions.size(), points.normals.size());
  EXPECT_EQ(points.positions.size(), points.colors.size());
  double area = 0;
  const Mesh mesh = read_mesh(path("map/mesh.glb"));
  for (const auto& t : mesh.triangles)
    area +=
        0.5 *
        static_cast<double>(
            (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm());
  EXPECT_GT(static_cast<double>(points.positions.size()), area / (0.05 * 0.05));
  EXPECT_LT(static_cast<double>(points.positions.size()), 2.5 * area / (0.05 * 0.05));

  exported("x.glb", {"--simplify", "0.4", "--lods", "3", "--texture"});
  std::size_t before = read_mesh(to("x.glb")).triangles.size();
  for (const char* name : {"x.lod1.glb", "x.lod2.glb"}) {
    EXPECT_EQ(validate_gltf(to(name)), "");
    const std::size_t now = read_mesh(to(name)).triangles.size();
    EXPECT_NEAR(static_cast<double>(now), 0.25 * static_cast<double>(before), 0.02 * static_cast<double>(before));
    before = now;
  }
}

TEST_F(Export, WritesTheGridsOfASession) {
  ASSERT_EQ(run_cairn({"export", path("map"), "-o", to("x.vdb")}).exit_code, 0);
  EXPECT_EQ(read_bytes(to("x.vdb")), read_bytes(path("map/map.vdb")));
  fs::remove(to("x.vdb"));
  expect_refused({}, "has no session", "x.vdb", "given");
}

TEST_F(Export, IsMeasuredByTheProgram) {
  exported("x.glb", {"--simplify", "0.1", "--texture"});
  const Ran topology = run_cairn({"evaluate", "topology", to("x.glb"), "--json"});
  ASSERT_EQ(topology.exit_code, 0) << topology.err;
  EXPECT_EQ(Json::parse(topology.out).at("non_manifold_edges"), 0);
  EXPECT_GT(Json::parse(topology.out).at("border_length_m").get<double>(), 1);
  const Ran views =
      run_cairn({"evaluate", "views", to("x.glb"), path("room"), "--trajectory", path("map/trajectory.txt"),
                 "--truth-trajectory", path("room"), "--step", "20", "--json"});
  ASSERT_EQ(views.exit_code, 0) << views.err;
  EXPECT_EQ(Json::parse(views.out).at("frames"), 3);
  EXPECT_GT(Json::parse(views.out).at("psnr_db").get<double>(), 25);
  // Images from poses in another frame do not match.
  const Ran beside = run_cairn({"evaluate", "views", to("x.glb"), path("room"), "--step", "20", "--json"});
  EXPECT_TRUE(beside.exit_code == 1 || Json::parse(beside.out).at("psnr_db").get<double>() < 22) << beside.out;
}

TEST_F(Export, OfAMapWithoutSessionIsItsMesh) {
  const Ran ran = run_cairn({"export", path("given"), "-o", to("x.glb"), "--simplify", "0.2"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(validate_gltf(to("x.glb")), "");
  fs::remove(to("x.glb"));
  expect_refused({"--texture"}, "has no keyframes", "x.glb", "given");
  expect_refused({"--texture"}, "has no keyframes", "x.glb", "map/map.vdb");
}

TEST_F(Export, TexturesAlsoWithGivenPoses) {
  const Ran ran = run_cairn({"reconstruct", path("room"), "-o", to("map"), "--voxel-size", "0.02", "--frames", "0:20",
                             "--poses", path("room/groundtruth.txt"), "--texture", "--simplify", "0.2"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_GT(read_mesh_parts(out / "map" / "mesh.glb").at(0).texture.width, 100);
}

TEST_F(Export, RejectsInvalidOptions) {
  expect_refused({}, "'.fbx' is not a supported output format; use .glb", "x.fbx");
  expect_refused({}, "'' is not a supported output format", "x");
  expect_refused({"--simplify", "0"}, "--simplify 0: number expected, 0.0001 to 1");
  expect_refused({"--simplify", "1.5"}, "--simplify 1.5: number expected, 0.0001 to 1");
  expect_refused({"--simplify", "nan"}, "--simplify nan: number expected");
  expect_refused({"--max-error", "-1"}, "--max-error -1: number expected, 0 to 1 m");
  expect_refused({"--texture-size", "7"}, "--texture-size 7: whole number expected, 64 to 16384 px");
  expect_refused({"--texture"}, "PLY, STL and LAS have no textures", "x.ply");
  expect_refused({"--texture"}, "PLY, STL and LAS have no textures", "x.las");
  // 10 million million points.
  expect_refused({"--points", "0.00001"}, "--points is 1e-05: that gives about", "x.ply");
  expect_refused({"--points", "0.00001"}, " GB of memory", "x.ply");
  expect_refused({"--points", "0.00001"}, " are free; use 0.0", "x.ply");
  expect_refused({"--points", "0.1"}, "--points needs .ply or .las");
  expect_refused({"--frame", "zup"}, "must be yup for USDZ", "x.usdz");
  expect_refused({"--compress", "draco"}, "--compress needs .glb", "x.obj");
  expect_refused({"--geo", "48.1,11.5,500,0"}, "--geo needs tileset.json", "x.glb");
  expect_refused({"--geo", "148.1,11.5,500,0"}, "--geo: the latitude is 148.1: it must be between -90 and 90",
                 "x.json");
  expect_refused({"--frame", "yup"}, "--frame must be zup for 3D Tiles", "x.json");
  expect_refused({"--cameras"}, "--cameras needs .glb", "x.ply");
  expect_refused({"--min-piece", "10"}, "no surface is left");
  EXPECT_EQ(run_cairn({"export", to("nowhere"), "-o", to("x.glb")}).exit_code, 2);
  expect_one_line(run_cairn({"reconstruct", path("room"), "-o", to("m"), "--simplify", "2"}), 2,
                  "--simplify 2: number expected");
}

TEST_F(Export, RejectsEmptyAndDamagedMaps) {
  const TemporaryFolder folder;
  const std::string broken = (folder / "broken.vdb").string();
  const FuseOptions fuse;
  const GridInfo info{.voxel_size = fuse.voxel_size, .truncation = fuse.truncation};
  const auto refuse = [&](const std::string& what) {
    expect_last_line(run_cairn({"export", broken, "-o", to("x.glb")}), 1, what);
    EXPECT_TRUE(fs::is_empty(out.path()));
  };
  write_grids(broken, BrickTree(), info);
  refuse("the map is empty");

  // A single brick with a surface of 8 cm, a floating component by default.
  BrickTree one;
  BrickVoxels voxels{};
  for (std::size_t i = 0; i < 512; ++i) {
    voxels[i] = shader::pack_voxel((static_cast<float>(i & 7) - 3.4f) / 4, 2, 0x01'30'80'ff);
  }
  one.put({0, 0, 0}, voxels);
  write_grids(broken, one, info);
  refuse("no surface is left");
  const Ran ran = run_cairn({"export", broken, "-o", to("one.glb"), "--min-piece", "0"});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(validate_gltf(to("one.glb")), "");
  EXPECT_EQ(read_mesh(to("one.glb")).triangles.size(), 98u - 2u);  // without two protruding corners
  fs::remove(to("one.glb"));

  openvdb::initialize();
  openvdb::io::File in(broken);
  in.open();
  openvdb::GridPtrVec grids = *in.getGrids();
  in.close();
  for (const auto& grid : grids)
    if (grid->getName() == "color")
      openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid)->tree().setValue({3, 3, 3},
                                                                      openvdb::Vec3s(0.5f, std::nanf(""), 0.5f));
  openvdb::io::File(broken).write(grids);
  refuse("voxel 3 3 3 has a value that is out of range or not a number");
}

TEST_F(Export, LeavesNothingHalfWrittenOnAFullDisk) {
  // A file size limit acts as a full disk.
  for (const auto& [file, kilobytes] : {std::pair("x.glb", 100),
                                        {"x.gltf", 100},
                                        {"x.ply", 100},
                                        {"x.obj", 100},
                                        {"x.stl", 100},
                                        {"x.usdz", 100},
                                        {"x.las", 100},
                                        {"tileset.json", 20}}) {
    std::vector<std::string> arguments{"export", path("map"), "-o", to(file), "--no-texture"};
    const Ran ran = run_cairn(arguments, with_files_of(static_cast<std::size_t>(kilobytes) << 10));
    expect_last_line(ran, 1, "File too large");
    EXPECT_FALSE(fs::exists(out / file));
    EXPECT_FALSE(fs::exists(out / "tileset.tiles"));
    for (const auto& entry : fs::directory_iterator(out.path()))
      EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path();
  }
  expect_last_line(run_cairn({"export", path("map"), "-o", "/proc/x/x.glb"}), 1, "/proc/x");
}

}  // namespace
}  // namespace cairn
