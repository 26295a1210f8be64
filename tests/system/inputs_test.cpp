// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Input files stay unchanged for any output path.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "cairn/io/recorder.hpp"
#include "cairn/mapping/rig.hpp"
#include "session/session_lock.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

/// Working folder with a small recording, a map of it, and files for options. Names are relative to the folder.
class Inputs : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    write_small_recording(*folder / "rec", {.frames = 16, .speed = 4});
    fs::create_directories(*folder / "own");
    fs::rename(*folder / "rec.yaml", *folder / "own/options.yaml");
    fs::copy(*folder / "rec" / "camera.yaml", *folder / "own/eye.yaml");
    const Ran ran = run({"reconstruct", "rec", "-o", "map", "--config", "own/options.yaml", "--no-texture"});
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    write_text(*folder / "own/points.csv", "x,y,z\n0,0,1\n");
    fs::copy(*folder / "map" / "graph.g2o", *folder / "own/graph.g2o");
    fs::copy(*folder / "map" / "trajectory.txt", *folder / "own/path.txt");
    ASSERT_EQ(run({"plan", "rec", "-o", "plan"}).exit_code, 0);
    setenv("CAIRN_VALIDATION", "0", 1);
  }
  static void TearDownTestSuite() {
    setenv("CAIRN_VALIDATION", "1", 1);
    delete folder;
  }
  static Ran run(const Words& arguments, const std::string& environment = "") {
    return run_cairn(arguments, "cd '" + folder->path().string() + "'; " + environment);
  }
  static Words reconstruct(const std::string& recording, const std::string& output, const Words& more = {}) {
    Words arguments{"reconstruct", recording, "-o", output, "--config", "own/options.yaml", "--no-texture"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  static void expect_refused(const Words& arguments, const std::string& expected) {
    std::string command;
    for (const std::string& word : arguments) command += word + " ";
    SCOPED_TRACE(command);
    const auto before = bytes_below(folder->path());
    expect_one_line(run(arguments), 1, expected);
    EXPECT_TRUE(bytes_below(folder->path()) == before);
  }
  static TemporaryFolder* folder;
};
TemporaryFolder* Inputs::folder = nullptr;

TEST_F(Inputs, AreRefusedAsOutputsByEveryCommand) {
  const std::string is = "is the input", inside = "is inside the input", holds = "contains the input";
  const std::vector<std::pair<Words, std::string>> refused{
      {reconstruct("rec", "rec"), is},
      {reconstruct("rec", "rec", {"--overwrite"}), is},
      {reconstruct("rec", "rec", {"--auto-name"}), is},
      {reconstruct("rec", "rec/out"), inside},
      {reconstruct("rec", "rec/depth/more/out"), inside},
      {reconstruct("rec", "."), holds},
      {reconstruct("rec", "own", {"--overwrite"}), holds},  // its --config
      {reconstruct("rec", "new", {"--log", "rec/x.mcap"}), inside},
      {reconstruct("rec", "map", {"--poses", "map/trajectory.txt", "--overwrite"}), holds},
      {reconstruct("rec", "map", {"--guess", "map/trajectory.txt", "--overwrite"}), holds},
      {reconstruct("plan/parts/000", "plan"), holds},
      {reconstruct("plan/parts/000", "plan/parts/000/map"), inside},
      {reconstruct("plan/parts/000", "rec"), is},  // its recording
      {{"reconstruct", "rec", "-o", "own", "--camera", "own/eye.yaml"}, holds},
      {{"live", "rec", "-o", "rec"}, is},
      {{"live", "rec", "-o", "new", "--log", "rec/x.mcap"}, inside},
      {{"record", "rec", "-o", "rec/again"}, inside},
      {{"convert", "rec", "-o", "rec/tum"}, inside},
      {{"convert", "rec", "-o", "."}, holds},
      {{"synth", "room", "-o", "own", "--camera", "own/eye.yaml", "--overwrite"}, holds},
      {{"synth", "room", "-o", "own", "--trajectory", "own/path.txt", "--overwrite"}, holds},
      {{"export", "map/map.vdb", "-o", "map/map.vdb"}, is},
      {{"export", "map", "-o", "map/session/x.glb"}, inside},
      {{"export", "map", "-o", "map", "--for", "colmap"}, is},
      {{"splat", "map", "-o", "map/session/x.spz"}, inside},
      {{"splat", "map", "-o", "rec/x.spz", "--recording", "rec"}, inside},
      {{"localize", "map", "rec", "-o", "rec/poses.txt"}, inside},
      {{"localize", "map", "rec", "-o", "map/session/poses.txt"}, inside},
      {{"esdf", "map", "-o", "map/map.vdb"}, is},
      {{"esdf", "map/map.vdb", "-o", "map/map.vdb"}, is},
      {{"esdf", "map", "-o", "own/points.csv", "--query", "own/points.csv"}, is},
      {{"merge", "map", "map", "-o", "map"}, is},
      {{"merge", "map", "map", "-o", "map/session/both"}, inside},
      {{"plan", "rec", "-o", "rec"}, is},
      {{"plan", "rec", "-o", "rec/plan"}, inside},
      {{"match", "map", "map", "-o", "map/session/state.cbor"}, inside},
      {{"tile", "plan", "--cell", "0,0,0", "-o", "plan"}, is},
      {{"tile", "plan", "--cell", "0,0,0", "-o", "plan/parts/000"}, inside},
      {{"tileset", "plan", "-o", "plan/parts/tileset.json"}, inside},
      {{"change", "map/map.vdb", "map", "-o", "map/map.vdb"}, is},
      {{"graph", "optimize", "own/graph.g2o", "-o", "own/graph.g2o"}, is},
      {{"calibrate", "rec", "-o", "rec/camera.yaml"}, inside},
      {{"calibrate", "rec", "-o", "own/eye.yaml", "--camera", "own/eye.yaml"}, is},
      {{"info", "rec", "--picture", "rec/picture.png"}, inside},
  };
  std::set<std::string> commands;
  for (const auto& [arguments, expected] : refused) {
    expect_refused(arguments, expected);
    commands.insert(arguments[0]);
  }
  // Covers every command with an output. A demo has no input; bench, optimize and the rest have no named output.
  std::istringstream man(run({"help", "--man"}).out);
  std::set<std::string> writing;
  std::string command;
  for (std::string line, word; std::getline(man, line);) {
    if (line.starts_with(".SS ")) std::istringstream(line) >> word >> word >> command;  // .SS cairn COMMAND
    for (const char* option : {"output", "log", "picture", "slice", "costmap"})
      if (line.find("\\fB\\-\\-" + std::string(option) + "\\fR") != line.npos) writing.insert(command);
  }
  writing.erase("demo");
  EXPECT_GE(writing.size(), 15u);
  for (const std::string& name : writing) EXPECT_TRUE(commands.contains(name)) << name;
}

TEST_F(Inputs, AreIdentifiedByInodeNotByName) {
  fs::create_directory_symlink(*folder / "rec", *folder / "link");
  fs::create_directory_symlink(*folder / "rec" / "depth", *folder / "depth-link");
  fs::create_hard_link(*folder / "map" / "map.vdb", *folder / "same.vdb");
  fs::create_symlink(*folder / "map" / "map.vdb", *folder / "link.vdb");
  fs::create_symlink(*folder / "rec" / "none.mcap", *folder / "nowhere.mcap");
  // A recording with its images elsewhere.
  fs::create_directory(*folder / "apart");
  for (const char* name : {"rgb.txt", "depth.txt", "camera.yaml"})
    fs::copy(*folder / "rec" / name, *folder / "apart" / name);
  for (const char* name : {"rgb", "depth"})
    fs::create_directory_symlink(*folder / "rec" / name, *folder / "apart" / name);
  const std::string base = folder->path().filename().string();
  for (const std::string& name :
       {std::string("link"), "../" + base + "/rec/", std::string("rec/../link/."), (*folder / "rec").string()})
    expect_refused(reconstruct("rec", name), "is the input");
  expect_refused(reconstruct("link", "rec"), "is the input");
  expect_refused(reconstruct("link", "rec/out"), "is inside the input");
  expect_refused(reconstruct("rec", "depth-link/out"), "is inside the input");
  expect_refused(reconstruct("rec", "new", {"--log", "nowhere.mcap"}), "is inside the input");
  expect_refused(reconstruct("apart", "rec/depth/out"), "is inside the input");
  expect_refused(reconstruct("apart", "rec"), "contains the input");
  for (const char* name : {"same.vdb", "link.vdb"}) expect_refused({"esdf", "map", "-o", name}, "is the input");
  for (const char* name : {"link", "depth-link", "same.vdb", "link.vdb", "nowhere.mcap", "apart"})
    fs::remove_all(*folder / name);
}

TEST_F(Inputs, MayHaveOutputsBesideThem) {
  const Words allowed[] = {{"export", "map", "-o", "map/more.ply", "--points", "0.1"},
                           {"export", "map/map.vdb", "-o", "map/mesh2.stl"},
                           {"export", "map", "-o", "map/map.vdb"},
                           {"esdf", "map", "-o", "map/esdf.vdb", "--slice", "y=0", "map/slice.png"},
                           {"graph", "optimize", "map/graph.g2o", "-o", "map/moved.g2o"},
                           {"info", "rec", "--picture", "picture.png"},
                           reconstruct("plan/parts/000", "plan/maps/000", {"--no-mesh"}),
                           reconstruct("rec", "rec-map", {"--log", "rec-map/x.mcap", "--poses", "own/path.txt"})};
  fs::create_directory(*folder / "rec-map");
  const auto recording = bytes_below(*folder / "rec");
  for (const Words& arguments : allowed) {
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.exit_code, 0) << arguments[0] << ": " << ran.err;
  }
  EXPECT_TRUE(bytes_below(*folder / "rec") == recording);
}

TEST_F(Inputs, ForeignLogIsNotOverwritten) {
  write_text(*folder / "ride.mcap", "somebody's recording");
  expect_last_line(run(reconstruct("rec", "logged", {"--log", "ride.mcap", "--overwrite"})), 1,
                   "is not a log of an earlier run");
  EXPECT_EQ(read_bytes(*folder / "ride.mcap"), "somebody's recording");
}

TEST_F(Inputs, ForeignFilesInAMapFolderStay) {
  fs::create_directories(*folder / "mine/session/run-0001");
  for (const char* name : {".cairn", "camera.yaml", "notes.txt", "session/run-0001/thesis.txt"})
    write_text(*folder / "mine" / name, "mine");
  for (const Words& more : {Words{}, Words{"--overwrite", "--poses", "own/path.txt"}}) {
    const Ran ran = run(reconstruct("rec", "mine", more));
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    for (const char* name : {".cairn", "camera.yaml", "notes.txt", "session/run-0001/thesis.txt"})
      EXPECT_EQ(read_bytes(*folder / "mine" / name), "mine") << name;
  }
  fs::create_directories(*folder / "locked/session");
  write_text(*folder / "locked/session/lock", "mine");
  expect_last_line(run(reconstruct("rec", "locked")), 1, "is not the lock file of a session");
  EXPECT_EQ(read_bytes(*folder / "locked/session/lock"), "mine");
}

TEST_F(Inputs, CameraFileStaysBesideTheMapsCameraFile) {
  fs::copy(*folder / "rec", *folder / "corrected", fs::copy_options::recursive);
  Rig rig = read_rig(*folder / "corrected" / "camera.yaml");
  rig.depth_correction.columns = 2, rig.depth_correction.rows = 2;
  rig.depth_correction.offsets = {0, 0.001f, 0, -0.001f};
  write_rig(*folder / "own/corrected.yaml", rig);
  ASSERT_EQ(run(reconstruct("corrected", "with-camera", {"--camera", "own/corrected.yaml"})).exit_code, 0);
  EXPECT_FALSE(fs::exists(*folder / "with-camera" / "camera.yaml"));
  EXPECT_EQ(read_rig(*folder / "with-camera" / "map_camera.yaml").depth_correction.offsets,
            rig.depth_correction.offsets);
  const auto judge = [&](const char* map) {
    const Ran ran = run({"evaluate", "map", map, "rec", "--json", "--step", "2"});
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return ran.out;
  };
  const std::string judged = judge("with-camera");
  // File name of version 0.1: read only for a report of that version.
  fs::copy(*folder / "with-camera", *folder / "old", fs::copy_options::recursive);
  fs::rename(*folder / "old" / "map_camera.yaml", *folder / "old" / "camera.yaml");
  auto report = nlohmann::json::parse(read_bytes(*folder / "old" / "report.json"));
  EXPECT_EQ(report["camera"], "map_camera.yaml");
  report.erase("camera");
  write_text(*folder / "old" / "report.json", report.dump());
  EXPECT_EQ(judge("old"), judged);
  ASSERT_EQ(run(reconstruct("rec", "with-camera", {"--overwrite"})).exit_code, 0);
  EXPECT_EQ(read_rig(*folder / "with-camera" / "map_camera.yaml"), read_rig(*folder / "rec" / "camera.yaml"));
}

TEST_F(Inputs, GivenPosesAreFusedByOneRunAtATime) {
  const Words posed = reconstruct("rec", "posed", {"--poses", "own/path.txt"});
  {
    const SessionLock lock(*folder / "posed" / "session");
    expect_last_line(run(posed), 1, "another run writes into it (process " + std::to_string(getpid()));
    EXPECT_FALSE(fs::exists(*folder / "posed" / "mesh.glb"));
  }
  EXPECT_EQ(run(posed).exit_code, 0);
  EXPECT_FALSE(fs::exists(*folder / "posed" / "session"));
}

}  // namespace
}  // namespace cairn
