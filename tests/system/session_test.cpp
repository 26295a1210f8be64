// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Runs resumed with another recording, and merged maps; faults_test.cpp has killed runs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "cairn/eval/evaluation.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "support/files.hpp"
#include "support/shared.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Two recordings of the room with half overlap, a recording of a corridor, and the map of the first.
class Session : public testing::Test {
 protected:
  /// Path of a recording or of the map; both are shared, so only copies may change.
  static std::string path(const std::string& name) {
    if (name == "map") return shared_map(path("room"), {"--frames", "0:60"}).string();
    return shared_recording({name, "--frames", "90", "--seed", name == "room" ? "1" : "3"}).string();
  }
  /// Copy of the map of the first 60 frames.
  [[nodiscard]] fs::path copy_of_map() const {
    fs::copy(path("map"), out / "map", fs::copy_options::recursive);
    return out / "map";
  }
  TemporaryFolder out;
};

/// Root mean square error in meters, aligned only by the session's very first pose, in first.txt beside it.
double error_in_place(const fs::path& estimate, const fs::path& truth) {
  const Trajectory found = read_trajectory(estimate), exact = read_trajectory(truth);
  // Stamps are in the estimated clock of the color camera: off by a fraction of a millisecond.
  const auto truth_at = [&](double time) {
    return *pose_at(exact, std::clamp(time, exact.front().timestamp, exact.back().timestamp));
  };
  const StampedPose first = read_trajectory(estimate.parent_path() / "first.txt").front();
  const Eigen::Isometry3d world_from_scene = first.world_from_camera * truth_at(first.timestamp).inverse();
  double squared = 0;
  for (const auto& pose : found)
    squared += (world_from_scene * truth_at(pose.timestamp).translation() - pose.world_from_camera.translation())
                   .squaredNorm();
  return std::sqrt(squared / static_cast<double>(found.size()));
}

TEST_F(Session, GoesOnWithAnotherRecordingOfTheSamePlace) {
  const fs::path map = copy_of_map();
  fs::copy(map / "trajectory.txt", map / "first.txt");
  // A recording of the same scene with a later start: identified by its first frames, not by its name.
  fs::copy(path("room"), out / "again", fs::copy_options::recursive);
  std::istringstream list(read_bytes(out / "again" / "depth.txt"));
  std::string later;
  int frames = 0;
  for (std::string line; std::getline(list, line);)
    if (line.starts_with('#') || ++frames > 5) later += line + '\n';
  write_text(out / "again" / "depth.txt", later);
  const Ran ran = run_cairn({"reconstruct", "--no-texture", (out / "again").string(), "-o", map.string(), "--frames",
                             "25:65", "--resume", "--json"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto report = nlohmann::json::parse(ran.out);
  EXPECT_EQ(report["submaps"]["components"], 1);
  EXPECT_GE(report["frames"]["fused"], 38);
  EXPECT_LT(error_in_place(map / "trajectory.txt", fs::path(path("room")) / "groundtruth.txt"), 0.01);
  // The previous recording keeps its trajectory.
  EXPECT_EQ(read_trajectory(map / "trajectory-000.txt").size(), 60u);
}

TEST_F(Session, BeginsAPieceOfItsOwnWhereNothingIsRecognized) {
  const fs::path map = copy_of_map();
  write_text(out / "soon.yaml", "map: {lost_frames: 15}\n");
  const Ran ran = run_cairn({"reconstruct", "--no-texture", path("corridor"), "-o", map.string(), "--frames", "0:45",
                             "--resume", "--config", (out / "soon.yaml").string(), "--json"});
  ASSERT_EQ(ran.exit_code, 3) << ran.err;
  const auto report = nlohmann::json::parse(ran.out);
  EXPECT_EQ(report["verdict"]["level"], "bad");
  EXPECT_EQ(report["submaps"]["components"], 2);
  EXPECT_GT(report["frames"]["fused"], 20);
  EXPECT_NE(ran.err.find("not connected by a loop"), std::string::npos) << ran.err;
  // The map still exists, without additions.
  EXPECT_EQ(read_trajectory(map / "trajectory-000.txt").size(), 60u);
  const auto before = nlohmann::json::parse(read_bytes(fs::path(path("map")) / "report.json"));
  EXPECT_EQ(report["mesh"]["triangles"], before["mesh"]["triangles"]);
}

TEST_F(Session, JoinsMapsOfTheSamePlace) {
  ASSERT_EQ(run_cairn({"reconstruct", "--no-texture", path("room"), "-o", (out / "b").string(), "--frames", "30:90"})
                .exit_code,
            0);
  const Ran ran = run_cairn({"merge", "--no-texture", path("map"), (out / "b").string(), "-o", (out / "c").string()},
                            "CAIRN_VALIDATION=1");
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_TRUE(fs::exists(out / "c" / "report.html"));
  fs::copy(out / "c" / "trajectory-000.txt", out / "c" / "first.txt");
  for (const char* trajectory : {"trajectory-000.txt", "trajectory.txt"})
    EXPECT_LT(error_in_place(out / "c" / trajectory, fs::path(path("room")) / "groundtruth.txt"), 0.01) << trajectory;
  EXPECT_EQ(validate_gltf(out / "c" / "mesh.glb"), "");
  // The merged map is a session as well.
  const Ran more = run_cairn(
      {"reconstruct", "--no-texture", path("room"), "-o", (out / "c").string(), "--frames", "60:75", "--resume"});
  EXPECT_EQ(more.exit_code, 0) << more.err;
}

TEST_F(Session, RefusesToJoinMapsOfDifferentPlaces) {
  ASSERT_EQ(run_cairn({"reconstruct", "--no-texture", path("corridor"), "-o", (out / "b").string(), "--frames", "0:30"})
                .exit_code,
            0);
  const std::string c = (out / "c").string();
  const std::string before = read_bytes(fs::path(path("map")) / "session" / "state.cbor");
  expect_one_line(run_cairn({"merge", "--no-texture", path("map"), (out / "b").string(), "-o", c}), 1,
                  "--allow-disconnected");
  EXPECT_FALSE(fs::exists(out / "c" / "session"));
  const Ran ran =
      run_cairn({"merge", "--no-texture", path("map"), (out / "b").string(), "-o", c, "--allow-disconnected"});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.out.find("separate component"), std::string::npos) << ran.out;
  EXPECT_EQ(read_bytes(fs::path(path("map")) / "session" / "state.cbor"), before);
  expect_one_line(run_cairn({"merge", "--no-texture", path("map"), path("map"), "-o", path("map")}), 1, "is the input");
  expect_one_line(run_cairn({"merge", "--no-texture", path("map"), path("room"), "-o", c}), 1, "no session");
}

TEST_F(Session, AnswersADamagedOneWithOneLine) {
  const fs::path map = copy_of_map(), state = map / "session" / "state.cbor";
  const std::vector<std::string> resume{"reconstruct", "--no-texture", path("room"), "-o", map.string(), "--resume"};
  const std::string good = read_bytes(state), mesh = read_bytes(map / "mesh.glb");

  std::string bad = good;
  bad[bad.size() / 2] = static_cast<char>(bad[bad.size() / 2] ^ 0x40);
  write_text(state, bad);
  expect_one_line(run_cairn(resume), 1, "is damaged");
  write_text(state, good.substr(0, good.size() / 3));
  expect_one_line(run_cairn(resume), 1, "is damaged");
  bad = good;
  bad[std::string("cairn session ").size()] = '7';  // format version
  write_text(state, bad);
  expect_one_line(run_cairn(resume), 1, "another version");
  write_text(state, "something else");
  expect_one_line(run_cairn(resume), 1, "does not begin with 'cairn session'");
  fs::remove(state);
  expect_one_line(run_cairn(resume), 1, "no session to resume");

  write_text(state, good);
  auto coarser = resume;
  coarser.insert(coarser.end(), {"--voxel-size", "0.02"});
  expect_one_line(run_cairn(coarser), 1, "--voxel-size");
  const fs::path run = map / "session" / "run-0001", corners = run / "keyframes" / "000001.corners";
  fs::rename(corners, map / "elsewhere");
  expect_one_line(run_cairn(resume), 1, "000001.corners");
  fs::rename(map / "elsewhere", corners);
  for (const auto& entry : fs::directory_iterator(run))
    if (entry.path().extension() == ".vdb") fs::resize_file(entry.path(), fs::file_size(entry.path()) / 2);
  expect_one_line(run_cairn(resume), 1, "damaged");
  // The earlier results still exist.
  EXPECT_TRUE(read_bytes(map / "mesh.glb") == mesh);
}

TEST_F(Session, IsNoReasonToLoseTheMapWhenItCannotBeWritten) {
  // Files of at most 64 KiB: keyframes, submaps and checkpoints fail, as on a full disk; the map fails as well, but the
  // previous results stay.
  const fs::path map = copy_of_map();
  const std::string mesh = read_bytes(map / "mesh.glb");
  const Ran full = run_cairn({"reconstruct", "--no-texture", path("room"), "-o", map.string(), "--frames", "60:70",
                              "--resume", "--checkpoint", "0"},
                             with_files_of(64 << 10));
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_NE(full.err.find("cannot write"), std::string::npos) << full.err;
  EXPECT_TRUE(read_bytes(map / "mesh.glb") == mesh);
  const Ran again =
      run_cairn({"reconstruct", "--no-texture", path("room"), "-o", map.string(), "--frames", "60:70", "--resume"});
  EXPECT_EQ(again.exit_code, 0) << again.err;
}

}  // namespace
}  // namespace cairn
