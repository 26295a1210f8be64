// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Files of merged maps: loops between maps, and sessions that refer to other sessions' keyframes and submaps.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cairn/building/project.hpp"
#include "cairn/mapping/session.hpp"
#include "multisession/cells.hpp"
#include "multisession/segment_loops.hpp"
#include "multisession/session_merger.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// A session of two keyframes. Always the same, since the tracked poses of its 8 cm voxels are 4 cm off, and those of
/// another version of the tracker decide otherwise about contradicting loops.
fs::path session_of_before() { return source_folder() / "tests/unit/session/format-16"; }

class MatchesFile : public testing::Test {
 protected:
  [[nodiscard]] fs::path file() const { return folder / "loops.json"; }
  [[nodiscard]] std::string refusal() const {
    try {
      (void)read_matches(file(), 10, 10);
      return {};
    } catch (const std::runtime_error& error) {
      return error.what();
    }
  }
  TemporaryFolder folder;
  Matches matches{.first = "0123456789abcdef",
                  .second = "fedcba9876543210",
                  .loops = {{.edge = {.i = 3,
                                      .j = 7,
                                      .i_from_j = retract((Vector6d() << 0.1, -0.2, 0.3, 1, 2, 3).finished()),
                                      .information = 1e4 * Matrix6d::Identity(),
                                      .is_loop_closure = true},
                             .feature_inliers = 40,
                             .inlier_share = 0.9,
                             .rmse = 0.7}}};
};

TEST_F(MatchesFile, RoundTripsExactly) {
  write_matches(file(), matches);
  const Matches read = read_matches(file(), 10, 10);
  EXPECT_EQ(read.first, matches.first);
  EXPECT_EQ(read.second, matches.second);
  ASSERT_EQ(read.loops.size(), 1u);
  const Loop &was = matches.loops[0], &is = read.loops[0];
  EXPECT_EQ(is.edge.i, was.edge.i);
  EXPECT_EQ(is.edge.j, was.edge.j);
  EXPECT_EQ(is.edge.i_from_j.matrix(), was.edge.i_from_j.matrix());
  EXPECT_EQ(is.edge.information, was.edge.information);
  EXPECT_TRUE(is.edge.is_loop_closure);
  EXPECT_EQ(is.feature_inliers, was.feature_inliers);
  EXPECT_EQ(is.inlier_share, was.inlier_share);
  EXPECT_EQ(is.rmse, was.rmse);
}

TEST_F(MatchesFile, RejectsOtherOrDamagedFilesByName) {
  write_matches(file(), matches);
  EXPECT_EQ(refusal(), "");
  const auto good = nlohmann::json::parse(read_bytes(file()));
  const auto refused = [&](const auto& change) {
    nlohmann::json bad = good;
    change(bad);
    write_text(file(), bad.dump());
    const std::string why = refusal();
    EXPECT_TRUE(why.starts_with(file().string())) << why;
    EXPECT_TRUE(why.ends_with("make it again with cairn match")) << why;
    return why;
  };
  EXPECT_NE(refused([](auto& j) { j["format"] = 2; }).find("another version"), std::string::npos);
  EXPECT_NE(refused([](auto& j) { j["kind"] = "cairn plan"; }).find("is not a file of loops"), std::string::npos);
  EXPECT_NE(refused([](auto& j) { j["loops"][0]["to"] = 10; }).find("keyframe"), std::string::npos);
  EXPECT_NE(refused([](auto& j) { j["loops"][0]["from_to"][0] = 2; }).find("pose"), std::string::npos);
  EXPECT_NE(refused([](auto& j) { j["loops"][0]["information"][0] = -1; }).find("positive"), std::string::npos);
  EXPECT_NE(refused([](auto& j) { j["loops"][0]["information"].erase(0); }).find("incomplete"), std::string::npos);
  EXPECT_NE(refused([](auto& j) { j.erase("loops"); }).find("damaged"), std::string::npos);
  write_text(file(), "{");
  EXPECT_NE(refusal().find("damaged"), std::string::npos);
}

/// Two copies of a small session, aligned by loops between equal keyframes.
class MergedProject : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"a", "b"}) fs::copy(session_of_before(), folder / name, fs::copy_options::recursive);
  }
  static Loop same(std::size_t keyframe, double offset = 0) {
    Loop loop{
        .edge = {.i = keyframe, .j = keyframe, .information = 1e4 * Matrix6d::Identity(), .is_loop_closure = true},
        .feature_inliers = 50};
    loop.edge.i_from_j.translation().x() = offset;
    return loop;
  }
  /// Merges the sessions in folder / "all".
  SessionMerger::Report merge(bool gather, double offset = 0) {
    const fs::path all = folder / "all";
    std::optional<ReadSession> earlier;
    if (fs::exists(all / "state.cbor")) earlier.emplace(read_session(all));
    SessionWriter writer(all);
    SessionMerger merger(writer);
    merger.add(folder / "a", 0);
    merger.add(folder / "b", 1);
    merger.add_loops(0, 1, {same(0, offset), same(0, offset), same(1, offset), same(1, offset)});
    const auto report = merger.merge();
    if (earlier) moved = merger.restore_poses(*earlier);
    earlier.reset();
    merger.write(gather);
    return report;
  }
  [[nodiscard]] std::vector<Eigen::Isometry3d> poses() const {
    return read_session(folder / "all").session.back_end.atlas.world_from_camera;
  }
  /// Moves the second map in the merged session, as if the previous merge had put it elsewhere.
  void move_second(double by) const {
    ReadSession read = read_session(folder / "all");
    auto& poses = read.session.back_end.atlas.world_from_camera;
    for (std::size_t k = read.source_maps.at(1).first_keyframe; k < poses.size(); ++k) poses[k].translation().x() += by;
    SessionWriter writer(folder / "all");
    writer.set_source_maps(read.source_maps);
    writer.write(read.session, {});
  }
  TemporaryFolder folder;
  std::vector<std::optional<double>> moved;
};

TEST_F(MergedProject, ContainsAllMapsWithFilesInPlace) {
  const auto report = merge(false);
  EXPECT_EQ(report.inliers, 4);
  const ReadSession read = read_session(folder / "all");
  ASSERT_EQ(read.source_maps.size(), 2u);
  EXPECT_EQ(read.source_maps[1].first_keyframe, 2u);
  EXPECT_TRUE(fs::is_empty(read.files / "keyframes"));
  Map one = Map::open(folder / "a"), all = Map::open(folder / "all");
  EXPECT_EQ(all.recordings(), 2);
  EXPECT_EQ(all.trajectory(0).size(), one.trajectory().size());
  EXPECT_EQ(all.trajectory(1).size(), one.trajectory().size());
  for (std::size_t i = 0; i < one.trajectory().size(); ++i)
    EXPECT_LT(
        (all.trajectory(0)[i].world_from_camera.translation() - all.trajectory(1)[i].world_from_camera.translation())
            .norm(),
        1e-4);
  // Both maps are rotated by the accelerometer; rarely observed surface at the rim is lost.
  EXPECT_GT(all.mesh().triangles.size(), one.mesh().triangles.size() * 2 / 3);
}

TEST_F(MergedProject, AlignsCovisibleKeyframes) {
  const auto report = merge(false, 0.01);
  EXPECT_GE(report.pairs, 4);
  EXPECT_GE(report.aligned, 2);
  const auto all = poses();
  const std::size_t second = read_session(folder / "all").source_maps.at(1).first_keyframe;
  for (std::size_t k = 0; k < second; ++k)  // the loops are off by a centimeter, the alignment of the surfaces corrects
                                            // them
    EXPECT_LT((all[k].translation() - all[second + k].translation()).norm(), 0.003) << k;
}

TEST_F(MergedProject, KeepsTheRecordingNumbersOfThePlan) {
  SessionWriter writer(folder / "all");
  SessionMerger merger(writer);
  merger.add(folder / "a", 0);
  merger.add(folder / "b", 2);
  merger.add_loops(0, 1, {same(0), same(0), same(1), same(1)});
  (void)merger.merge(4);
  merger.write();
  const Map all = Map::open(folder / "all");
  EXPECT_EQ(all.recordings(), 4);
  EXPECT_GT(all.trajectory(0).size(), 0u);
  EXPECT_EQ(all.trajectory(1).size(), 0u);
  EXPECT_EQ(all.trajectory(2).size(), all.trajectory(0).size());
  EXPECT_EQ(all.trajectory(3).size(), 0u);
}

TEST_F(MergedProject, ReportsTheMissingPart) {
  (void)merge(false);
  fs::remove_all(folder / "b/run-0001");
  try {
    (void)Map::open(folder / "all");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("b/run-0001: is missing"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("run cairn optimize again"), std::string::npos) << error.what();
  }
}

TEST_F(MergedProject, CanBeMovedWithItsParts) {
  (void)merge(false);
  const TemporaryFolder other;
  fs::copy(folder.path(), other / "moved", fs::copy_options::recursive);
  fs::remove_all(folder / "a");
  EXPECT_GT(Map::open(other / "moved/all").mesh().triangles.size(), 2000u);
}

TEST_F(MergedProject, GatheredIsSelfContained) {
  (void)merge(true);
  fs::remove_all(folder / "a"), fs::remove_all(folder / "b");
  Session session = Session::resume(folder / "all");
  Mapper mapper = session.mapper();
  EXPECT_EQ(mapper.recordings(), 2);
  EXPECT_GT(mapper.map().mesh().triangles.size(), 2000u);
  EXPECT_EQ(read_session(folder / "all").source_maps.size(), 0u);
}

TEST_F(MergedProject, KeepsPosesThatMoveOnlySlightly) {
  (void)merge(false);
  const auto together = poses();
  move_second(0.005);  // with voxels of 8 cm
  const auto before = poses();
  (void)merge(false);
  EXPECT_GT(moved.at(1).value(), 0.001);
  const auto after = poses();
  for (std::size_t k = 0; k < before.size(); ++k) EXPECT_EQ(before[k].matrix(), after[k].matrix());
  move_second(0.1);
  (void)merge(false);
  const auto then = poses();
  EXPECT_LT((then[2].translation() - together[2].translation()).norm(), 0.001);
}

}  // namespace
}  // namespace cairn
