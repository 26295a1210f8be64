// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Two recordings of a room before and after a box was added, with the program.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cairn/mapping/mesh.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Plan of both recordings with its map, made once.
class ChangedRoom : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    write_small_recording(*folder_ / "monday");
    write_small_recording(*folder_ / "tuesday", {.more = {{.shape = Scene::Shape::box,
                                                           .center = kBox,
                                                           .half_size = Eigen::Vector3f::Constant(kHalf),
                                                           .pattern = Scene::Pattern::checker}}});
    expect_done({"plan", in("monday"), in("tuesday"), "-o", in("plan")});
    for (const char* part : {"000", "001"})
      expect_done({"reconstruct", in("plan/parts/") + part, "-o", in("plan/maps/") + part, "--no-mesh", "--config",
                   in("monday.yaml")});
    fs::create_directories(in("plan/loops"));
    expect_done({"match", in("plan/maps/000"), in("plan/maps/001"), "-o", in("plan/loops/000-001.json")});
    expect_done({"optimize", in("plan")});
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static std::string in(const std::string& name) { return (*folder_ / name).string(); }
  static std::string expect_done(const std::vector<std::string>& words) {
    const Ran ran = run_cairn(words, "CAIRN_VALIDATION=1");
    EXPECT_EQ(ran.exit_code, 0) << words[0] << ": " << ran.err;
    return ran.out;
  }
  static constexpr float kHalf = 0.25f;               // meters
  static inline const Eigen::Vector3f kBox{0, 0, 1};  // in front of the camera, in previously free space
  static inline TemporaryFolder* folder_ = nullptr;
  TemporaryFolder out;
};

TEST_F(ChangedRoom, FindsTheAddedBox) {
  const std::string file = (out / "change.glb").string();
  const Json json = Json::parse(expect_done({"change", in("plan"), "--since", "tuesday", "-o", file, "--json"}));
  ASSERT_EQ(json.at("pieces").size(), 1u) << json.dump(1);
  const Json& region = json.at("pieces").at(0);
  EXPECT_EQ(region.at("kind"), "new");
  // Visible: at least one side except its rim, at most three sides.
  const double side = 4.0 * static_cast<double>(kHalf * kHalf);
  EXPECT_GT(region.at("area_m2"), 0.5 * side);
  EXPECT_LT(region.at("area_m2"), 3.2 * side);
  EXPECT_EQ(json.at("new_m2"), region.at("area_m2"));
  EXPECT_EQ(json.at("gone_m2"), 0.0);
  EXPECT_NEAR(json.at("distance_m"), 0.12, 1e-6);
  EXPECT_GT(json.at("both_seen_m2"), 5.0);
  const auto extent = region.at("extent_m").get<std::vector<double>>();
  EXPECT_LT(*std::max_element(extent.begin(), extent.end()), 0.75);
  EXPECT_EQ(validate_gltf(file), "");
  EXPECT_EQ(read_mesh(file).triangles.size(), json.at("triangles"));
  EXPECT_EQ(Json::parse(expect_done({"change", in("plan"), "--since", "1", "-o", file, "--json"})), json);
}

TEST_F(ChangedRoom, IsPrintedAsText) {
  const std::string output = expect_done({"change", in("plan"), "--since", "1", "-o", (out / "change.glb").string()});
  EXPECT_NE(output.find(" m2 in 1 components (blue)"), std::string::npos) << output;
  EXPECT_NE(output.find("gone    0.00 m2 in 0 components (orange)"), std::string::npos) << output;
  EXPECT_NE(output.find("distances below 120 mm are no change"), std::string::npos) << output;
}

TEST_F(ChangedRoom, AnswersBadInputWithOneLine) {
  const std::string file = (out / "change.glb").string();
  const auto refused = [&](std::vector<std::string> words, int code, const std::string& what) {
    words.insert(words.begin(), "change");
    words.insert(words.end(), {"-o", file});
    expect_last_line(run_cairn(words), code, what);
    EXPECT_FALSE(fs::exists(file));
  };
  refused({in("plan"), "--since", "sunday"}, 1, "no recording matches 'sunday'; recordings: 0: monday, 1: tuesday");
  refused({in("plan"), "--since", "0"}, 1, "recording 0 is missing or has no earlier recording");
  refused({in("plan"), "--since", "2"}, 1, "no recording matches '2'");
  refused({in("plan/maps/000"), "--since", "1"}, 1, "is not a project");
  refused({in("plan")}, 2, "needs AFTER, or --since");
  refused({in("plan"), in("plan"), "--since", "1"}, 2, "not both");
  refused({in("plan"), in("nowhere")}, 2, "nowhere");
  refused({in("plan"), "--since", "1", "--distance", "0.5"}, 1, "must be between 0.03 and 0.24");
}

TEST_F(ChangedRoom, HasAFloorPlanWithBothRecordings) {
  const std::string file = (out / "plan.svg").string();
  const Json json = Json::parse(
      expect_done({"export", in("plan"), "-o", file, "--path", "--loops", "--coverage", "--height", "0.8", "--json"}));
  const std::string svg = read_bytes(file);
  for (const char* layer : {"Path of the camera: monday", "Path of the camera: tuesday", "Loops between recordings",
                            "Not looked at", "Legend: path: tuesday"})
    EXPECT_NE(svg.find(std::string("inkscape:label=\"") + layer + '"'), std::string::npos) << layer;
  EXPECT_GT(json.at("loops").at("between_recordings"), 0);
  EXPECT_GE(json.at("loops").at("drawn"), json.at("loops").at("between_recordings"));
  const Json& storey = json.at("storeys").at(0);
  EXPECT_GE(storey.at("not_looked_at_m2"), 0.0);
  EXPECT_LT(storey.at("not_looked_at_share"), 1.0);
  const std::string output = expect_done({"export", in("plan"), "-o", file, "--coverage", "--height", "0.8"});
  EXPECT_NE(output.find(" m2 within its outline are unobserved"), std::string::npos) << output;
}

}  // namespace
}  // namespace cairn
