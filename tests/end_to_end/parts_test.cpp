// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A map made of parts, by the program: from a plan to tiles.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "base/json_text.hpp"
#include "cairn/evaluation.hpp"
#include "cairn/mesh.hpp"
#include "cairn/source.hpp"
#include "cairn/trajectory.hpp"
#include "support/files.hpp"
#include "support/shared.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kFrames = 90;

/// A room's recording in two parts, and their maps, made once.
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
  Json optimised() {
    fs::create_directories(plan / "loops");
    const Json matched =
        Json::parse(expect_done({"match", in("maps/000"), in("maps/001"), "-o", in("loops/000-001.json"), "--json"}));
    EXPECT_GT(matched.at("loops"), 0);
    return Json::parse(expect_done({"optimise", plan.string(), "--json"}));
  }
  /// By the names of the files in PLAN/cells.
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

/// Edges that one triangle alone has, of vertices that lie at the same place to the last bit.
std::size_t open_edges(const std::vector<Mesh>& parts) {
  using Place = std::array<float, 3>;
  std::map<Place, std::uint32_t> number;
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const Mesh& mesh : parts)
    for (const auto& t : mesh.triangles) {
      std::array<std::uint32_t, 3> v{};
      for (std::size_t i = 0; i < 3; ++i) {
        const Eigen::Vector3f& p = mesh.positions[t[i]];
        v[i] = number.try_emplace(Place{p.x(), p.y(), p.z()}, static_cast<std::uint32_t>(number.size())).first->second;
      }
      for (std::size_t i = 0; i < 3; ++i) ++edges[std::minmax(v[i], v[(i + 1) % 3])];
    }
  return static_cast<std::size_t>(
      std::count_if(edges.begin(), edges.end(), [](const auto& e) { return e.second == 1; }));
}

TEST_F(MapOfParts, BecomesTilesWithoutACrackBetweenCells) {
  const Json report = optimised();
  EXPECT_TRUE(report.at("parts").at(1).at("joined"));
  EXPECT_GT(report.at("loops").at("overlapping_frames"), 0);
  const Trajectory trajectory = read_trajectory(plan / "trajectory.txt");
  EXPECT_EQ(trajectory.size(), static_cast<std::size_t>(kFrames));
  EXPECT_LT(evaluate_trajectory(trajectory, recorded_truth(recording_)).ate.rmse, 0.01);

  ASSERT_GT(cells().size(), 1u);
  std::vector<Mesh> leaves;
  for (const std::string& cell : cells()) {
    expect_done({"tile", plan.string(), "--cell=" + cell, "-o", in("tiles/" + cell), "--no-texture"});
    EXPECT_TRUE(fs::exists(plan / "tiles" / cell / "map.vdb"));
    for (const auto& entry : fs::recursive_directory_iterator(plan / "tiles" / cell)) {
      if (entry.path().extension() != ".glb") continue;
      EXPECT_EQ(validate_gltf(entry.path()), "");
      if (entry.path().filename().string().starts_with("0_")) leaves.push_back(read_mesh(entry.path()));
    }
  }
  expect_done({"tileset", plan.string(), "-o", in("tileset.json")});
  const Json tileset = Json::parse(read_bytes(plan / "tileset.json"));
  EXPECT_EQ(tileset.at("root").at("refine"), "REPLACE");
  EXPECT_TRUE(fs::exists(plan / tileset.at("root").at("content").at("uri").get<std::string>()));
  EXPECT_NE(tileset.dump().find(as_uri("tiles/" + cells()[0] + "/tileset.json")), std::string::npos);

  expect_done({"export", plan.string(), "-o", in("whole.ply")});
  const std::vector<Mesh> whole{read_mesh(plan / "whole.ply")};
  EXPECT_GT(whole[0].triangles.size(), 10000u);
  std::size_t triangles = 0;
  for (const Mesh& leaf : leaves) triangles += leaf.triangles.size();
  EXPECT_EQ(triangles, whole[0].triangles.size());
  EXPECT_EQ(open_edges(leaves), open_edges(whole));
}

TEST_F(MapOfParts, StaysUntouchedWhereNothingIsNew) {
  const Json first = optimised();
  EXPECT_EQ(first.at("cells").at("changed"), first.at("cells").at("count"));
  const std::string trajectory = read_bytes(plan / "trajectory.txt");
  std::vector<fs::file_time_type> times;
  for (const std::string& cell : cells()) times.push_back(fs::last_write_time(plan / "cells" / (cell + ".json")));
  const Json again = optimised();
  EXPECT_EQ(again.at("cells").at("changed"), 0);
  EXPECT_EQ(read_bytes(plan / "trajectory.txt"), trajectory);
  for (std::size_t i = 0; i < times.size(); ++i)
    EXPECT_EQ(fs::last_write_time(plan / "cells" / (cells()[i] + ".json")), times[i]);
}

TEST_F(MapOfParts, LeavesOutWhatHasNoMapOrJoinsNothing) {
  fs::remove_all(plan / "maps/001");
  const Ran ran = run_cairn({"optimise", plan.string()});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.out.find("1 of 2 parts joined"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("part 001 is left out: it has no map"), std::string::npos) << ran.out;
  EXPECT_EQ(Json::parse(read_bytes(plan / "report.json")).at("parts").at(1).at("left_out"), "it has no map");
}

TEST_F(MapOfParts, AnswersBadInputWithOneLine) {
  const std::string loops = in("loops/000-001.json");
  (void)optimised();
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
  expect_one_line(run_cairn({"optimise", plan.string()}), 1, "make it again with cairn match");
  write_text(loops, "{}");
  expect_one_line(run_cairn({"optimise", plan.string()}), 1, "is damaged");
  EXPECT_EQ(read_bytes(plan / "session/state.cbor"), session);  // it counts as before
  EXPECT_EQ(run_cairn({"tile", plan.string(), "--cell=" + cells()[0], "-o", in("tiles/a"), "--no-texture"}).exit_code,
            0);
  fs::remove_all(plan / "maps/000/session");
  expect_one_line(run_cairn({"tile", plan.string(), "--cell=" + cells()[0], "-o", in("tiles/b")}), 1,
                  "make the map of all parts again");
}

}  // namespace
}  // namespace cairn
