// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Map of segments with the program: from a plan to tiles.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "base/json_text.hpp"
#include "cairn/building/project.hpp"
#include "cairn/eval/evaluation.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "support/files.hpp"
#include "support/shared.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kFrames = 90;

/// A room's recording in two segments, and their maps, made once.
class MapOfParts : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made_ = new TemporaryFolder;
    recording_ = shared_recording({"room", "--frames", std::to_string(kFrames), "--seed", "1"});
    const std::string plan = (made_->path() / "plan").string();
    expect_done({"plan", recording_.string(), "-o", plan, "--frames-per-part", "45", "--overlap", "15"});
    for (const char* part : {"000", "001"})
      expect_done(
          {"reconstruct", plan + "/parts/" + part, "-o", plan + "/maps/" + part, "--no-mesh", "--voxel-size", "0.03"});
  }
  static void TearDownTestSuite() {
    delete made_;
    made_ = nullptr;
  }
  void SetUp() override {
    plan = folder / "plan";
    fs::copy(*made_ / "plan", plan, fs::copy_options::recursive);
  }
  static std::string expect_done(const std::vector<std::string>& words) {
    const Ran ran = run_cairn(words, "CAIRN_VALIDATION=1");
    EXPECT_EQ(ran.exit_code, 0) << words[0] << ": " << ran.err;
    return ran.out;
  }
  [[nodiscard]] std::string in(const std::string& name) const { return (plan / name).string(); }
  Json optimized() {
    fs::create_directories(plan / "loops");
    const Json matched =
        Json::parse(expect_done({"match", in("maps/000"), in("maps/001"), "-o", in("loops/000-001.json"), "--json"}));
    EXPECT_GT(matched.at("loops"), 0);
    return Json::parse(expect_done({"optimize", plan.string(), "--json"}));
  }
  /// Cell names from the files in PLAN/cells.
  [[nodiscard]] std::vector<std::string> cells() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(plan / "cells")) names.push_back(entry.path().stem().string());
    std::sort(names.begin(), names.end());
    return names;
  }
  static inline TemporaryFolder* made_ = nullptr;
  static inline fs::path recording_;
  TemporaryFolder folder;
  fs::path plan;
};

using Place = std::array<float, 3>;
using Edge = std::pair<Place, Place>;

/// Edges of a single triangle; vertices are identified by exact position.
std::set<Edge> open_edges(const std::vector<Mesh>& parts) {
  std::map<Edge, int> edges;
  for (const Mesh& mesh : parts)
    for (const auto& t : mesh.triangles) {
      const auto place = [&](std::size_t i) {
        const Eigen::Vector3f& p = mesh.positions[t[i % 3]];
        return Place{p.x(), p.y(), p.z()};
      };
      for (std::size_t i = 0; i < 3; ++i) ++edges[std::minmax({place(i), place(i + 1)})];
    }
  std::set<Edge> open;
  for (const auto& [edge, triangles] : edges)
    if (triangles == 1) open.insert(edge);
  return open;
}

TEST_F(MapOfParts, BecomesTilesWithoutCracksBetweenCells) {
  const Json report = optimized();
  EXPECT_TRUE(report.at("parts").at(1).at("joined"));
  EXPECT_GT(report.at("loops").at("overlapping_frames"), 0);
  const Trajectory trajectory = read_trajectory(plan / "trajectory.txt");
  EXPECT_EQ(trajectory.size(), static_cast<std::size_t>(kFrames));
  EXPECT_LT(evaluate_trajectory(trajectory, recorded_truth(recording_)).ate.rmse, 0.01);

  ASSERT_GT(cells().size(), 1u);
  std::vector<Mesh> leaves;
  std::map<std::string, std::map<char, std::vector<Mesh>>> levels;  // of each cell
  for (const std::string& cell : cells()) {
    expect_done({"tile", plan.string(), "--cell=" + cell, "-o", in("tiles/" + cell), "--no-texture"});
    EXPECT_TRUE(fs::exists(plan / "tiles" / cell / "map.vdb"));
    for (const auto& entry : fs::recursive_directory_iterator(plan / "tiles" / cell)) {
      if (entry.path().extension() != ".glb") continue;
      EXPECT_EQ(validate_gltf(entry.path()), "");
      const char level = entry.path().filename().string()[0];
      levels[cell][level].push_back(read_mesh(entry.path()));
      if (level == '0') leaves.push_back(levels[cell][level].back());
    }
  }
  expect_done({"tileset", plan.string(), "-o", in("tileset.json")});
  const Json tileset = Json::parse(read_bytes(plan / "tileset.json"));
  EXPECT_EQ(tileset.at("root").at("refine"), "REPLACE");
  EXPECT_TRUE(fs::exists(plan / tileset.at("root").at("content").at("uri").get<std::string>()));
  EXPECT_NE(tileset.dump().find(as_uri("tiles/" + cells()[0] + "/tileset.json")), std::string::npos);

  expect_done({"export", plan.string(), "-o", in("whole.ply")});
  const std::vector<Mesh> complete{read_mesh(plan / "whole.ply")};
  EXPECT_GT(complete[0].triangles.size(), 10000u);
  std::size_t triangles = 0;
  for (const Mesh& leaf : leaves) triangles += leaf.triangles.size();
  EXPECT_EQ(triangles, complete[0].triangles.size());
  EXPECT_EQ(open_edges(leaves).size(), open_edges(complete).size());

  // Each level of a cell has all edges shared between its finest level and its neighbors' finest levels.
  std::map<std::string, std::map<char, std::set<Edge>>> open;
  for (const auto& [cell, meshes] : levels)
    for (const auto& [level, tiles] : meshes) open[cell][level] = open_edges(tiles);
  std::size_t shared = 0, missing = 0, coarser = 0;
  for (const auto& [cell, own] : open)
    for (const auto& [other, others] : open)
      for (const Edge& edge : own.at('0')) {
        if (cell == other || !others.at('0').contains(edge)) continue;
        ++shared;
        for (const auto& [level, edges] : own) {
          coarser += level != '0';
          missing += !edges.contains(edge);
        }
      }
  EXPECT_GT(shared, 100u);
  EXPECT_GT(coarser, 100u);
  EXPECT_EQ(missing, 0u);
}

TEST_F(MapOfParts, HasTheSameDistancesCellByCell) {
  (void)optimized();
  ASSERT_GT(cells().size(), 1u);
  const std::string refused = "--cell=" + cells()[0];
  expect_one_line(run_cairn({"esdf", plan.string(), refused, "-o", in("x.vdb")}), 1, "make it with cairn tile");
  for (const std::string& cell : cells())
    expect_done({"tile", plan.string(), "--cell=" + cell, "-o", in("tiles/" + cell), "--no-texture"});
  expect_one_line(run_cairn({"esdf", plan.string(), "-o", in("x.vdb")}), 2, "are written per cell");
  expect_one_line(run_cairn({"esdf", plan.string(), "--cell=9,9,9", "-o", in("x.vdb")}), 1, "does not reach");

  std::string points = "x,y,z\n9,9,9\n";
  for (int i = 0; i < 2000; ++i)
    points += fmt::format("{},{},{}\n", -2 + 0.4 * (i % 10), -1 + 0.2 * (i / 10 % 10), -3 + 0.3 * (i / 100));
  write_text(plan / "points.csv", points);
  const std::vector<std::string> asked{"--query", in("points.csv"), "--max-distance", "0.7",      "--robot-radius",
                                       "0.3",     "--costmap",      in("cells.yaml"), "--height", "-1:0.3"};
  const auto answers = [&](std::vector<std::string> words, const std::string& costmap) {
    words.insert(words.end(), asked.begin(), asked.end());
    words[words.size() - 3] = in(costmap);
    return expect_done(words);
  };
  const std::string by_cell = answers({"esdf", plan.string()}, "cells.yaml");
  const std::string up = "--up=-x", turned = expect_done({"esdf", plan.string(), up, "--query", in("points.csv")});
  write_text(plan / "far.csv", "x,y,z\n99,99,99\n");
  const auto far = nlohmann::json::parse(
      expect_done({"esdf", plan.string(), "--query", in("far.csv"), "--json", "-o", in("far_answers.csv")}));
  EXPECT_EQ(far["points"], 1);
  EXPECT_EQ(far["known_points"], 0);
  {  // a cell knows its points before its neighbors' voxels are read
    const auto [x, y, z] = cells_of(plan)[1];
    const fs::path neighbor = plan / "tiles" / fmt::format("{},{},{}", x, y, z) / "map.vdb", hidden = plan / "hidden";
    fs::rename(neighbor, hidden);
    CellMap cell(plan, cells_of(plan)[0], 0.7);
    EXPECT_FALSE(cell.contains({99, 99, 99}));
    EXPECT_THROW((void)cell.map(), std::runtime_error);
    fs::rename(hidden, neighbor);
    EXPECT_NO_THROW((void)cell.map());
  }
  std::vector<DistanceField> fields;
  for (const std::string& cell : cells()) {
    expect_done({"esdf", plan.string(), "--cell=" + cell, "-o", in("tiles/" + cell + "/esdf.vdb"), "--max-distance",
                 "0.7", "--robot-radius", "0.3"});
    fields.push_back(DistanceField::read(plan / "tiles" / cell / "esdf.vdb"));
  }
  expect_done({"export", plan.string(), "-o", in("map.vdb")});
  EXPECT_EQ(by_cell, answers({"esdf", plan.string()}, "whole.yaml"));
  EXPECT_EQ(turned, expect_done({"esdf", plan.string(), up, "--query", in("points.csv")}));
  EXPECT_GT(std::count(by_cell.begin(), by_cell.end(), '\n'), 2000);
  EXPECT_NE(by_cell.find("9,9,9,,,,,unknown"), std::string::npos);

  expect_done({"esdf", plan.string(), "-o", in("whole.vdb"), "--max-distance", "0.7", "--robot-radius", "0.3"});
  std::map<std::array<int, 3>, const DistanceField::Block*> blocks;
  for (const DistanceField& field : fields)
    for (const auto& [block, samples] : field.blocks())
      EXPECT_TRUE(blocks.emplace(std::array{block.x(), block.y(), block.z()}, samples.get()).second);
  const DistanceField complete = DistanceField::read(plan / "whole.vdb");
  EXPECT_GT(blocks.size(), 40u);
  for (const auto& [block, samples] : complete.blocks()) {
    const auto found = blocks.find({block.x(), block.y(), block.z()});
    if (found == blocks.end()) {  // free, in a cell without a surface
      const auto cell = [](int i) { return (i - (i % 32 + 32) % 32) / 32; };
      const auto name = fmt::format("{},{},{}", cell(block.x()), cell(block.y()), cell(block.z()));
      EXPECT_FALSE(fs::exists(plan / "tiles" / name)) << name;
      continue;
    }
    EXPECT_EQ(std::memcmp(found->second, samples.get(), sizeof(*samples)), 0);
  }

  const cv::Mat of_cells = cv::imread(in("cells.pgm"), cv::IMREAD_UNCHANGED),
                of_whole = cv::imread(in("whole.pgm"), cv::IMREAD_UNCHANGED);
  for (const int value : {0, 254})
    EXPECT_NEAR(cv::countNonZero(of_cells == value), cv::countNonZero(of_whole == value),
                0.02 * cv::countNonZero(of_whole == value))
        << value;
}

TEST_F(MapOfParts, StaysUnchangedWithoutNewData) {
  const Json first = optimized();
  EXPECT_EQ(first.at("cells").at("changed"), first.at("cells").at("count"));
  const std::string trajectory = read_bytes(plan / "trajectory.txt");
  std::vector<fs::file_time_type> times;
  for (const std::string& cell : cells()) times.push_back(fs::last_write_time(plan / "cells" / (cell + ".json")));
  const Json again = optimized();
  EXPECT_EQ(again.at("cells").at("changed"), 0);
  EXPECT_EQ(read_bytes(plan / "trajectory.txt"), trajectory);
  for (std::size_t i = 0; i < times.size(); ++i)
    EXPECT_EQ(fs::last_write_time(plan / "cells" / (cells()[i] + ".json")), times[i]);
}

TEST_F(MapOfParts, OmitsPartsWithoutMapOrConnection) {
  fs::remove_all(plan / "maps/001");
  const Ran ran = run_cairn({"optimize", plan.string()});
  EXPECT_EQ(ran.exit_code, 3) << ran.err;
  EXPECT_NE(ran.out.find("1 of 2 segments merged"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("BAD: 1 of 2 parts are in the map, with "), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find(", frames 37 to 89) is not in the map: it has no map"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("next: cairn reconstruct "), std::string::npos) << ran.out;
  EXPECT_EQ(Json::parse(read_bytes(plan / "report.json")).at("verdict").at("level"), "bad");
  EXPECT_EQ(Json::parse(read_bytes(plan / "report.json")).at("parts").at(1).at("left_out"), "it has no map");
  const Ran drawn = run_cairn({"export", plan.string(), "-o", in("plan.svg"), "--json"});
  EXPECT_EQ(drawn.exit_code, 0) << drawn.err;
  EXPECT_NE(drawn.err.find("1 of 1 recordings of the project are missing or incomplete in the map"), std::string::npos);
  EXPECT_EQ(Json::parse(drawn.out).at("missing_recordings").size(), 1);
  EXPECT_NE(read_bytes(in("plan.svg")).find("Not in this map"), std::string::npos);
}

TEST_F(MapOfParts, AnswersBadInputWithOneLine) {
  const std::string loops = in("loops/000-001.json");
  (void)optimized();
  const std::string session = read_bytes(plan / "session/state.cbor");
  expect_one_line(run_cairn({"match", in("maps/000"), recording_.string(), "-o", in("x.json")}), 1, "session");
  expect_one_line(run_cairn({"tile", plan.string(), "--cell=9,9,9", "-o", in("tiles/9,9,9")}), 1,
                  "the map does not reach cell 9,9,9");
  expect_one_line(run_cairn({"tile", plan.string(), "--cell=9,9", "-o", in("tiles/9,9")}), 2, "is not X,Y,Z");
  expect_one_line(run_cairn({"tileset", plan.string(), "-o", in("tileset.json")}), 1, "make it with cairn tile");
  EXPECT_FALSE(fs::exists(plan / "tileset.json"));
  Json other = Json::parse(read_bytes(loops));
  other["maps"][0] = "0000000000000000";
  write_text(loops, other.dump());
  expect_one_line(run_cairn({"optimize", plan.string()}), 1, "make it again with cairn match");
  write_text(loops, "{}");
  expect_one_line(run_cairn({"optimize", plan.string()}), 1, "is damaged");
  EXPECT_EQ(read_bytes(plan / "session/state.cbor"), session);  // still valid
  EXPECT_EQ(run_cairn({"tile", plan.string(), "--cell=" + cells()[0], "-o", in("tiles/a"), "--no-texture"}).exit_code,
            0);
  fs::remove_all(plan / "maps/000/session");
  expect_one_line(run_cairn({"tile", plan.string(), "--cell=" + cells()[0], "-o", in("tiles/b")}), 1,
                  "run cairn optimize again");
}

}  // namespace
}  // namespace cairn
