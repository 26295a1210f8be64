// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Outputs of runs: under any name, only after success, and without damage to an earlier run.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <future>
#include <map>
#include <nlohmann/json.hpp>

#include "cairn/mapping/mapper.hpp"
#include "session/session_lock.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Working folder with small recordings and a map. Names are relative to the folder.
class Outputs : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    write_small_recording(*folder / "rec", {.frames = 20, .speed = 4});
    write_small_recording(*folder / "other", {.frames = 12, .scene = "corridor"});
    write_small_recording(*folder / "gray", {.frames = 12, .color = false});
    write_small_recording(*folder / "long-gray", {.frames = 40, .color = false});
    const Ran ran = run(reconstruct("rec", "map"));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    // The run above was validated; the following runs repeat it.
    setenv("CAIRN_VALIDATION", "0", 1);
  }
  static void TearDownTestSuite() {
    setenv("CAIRN_VALIDATION", "1", 1);
    delete folder;
  }
  static Ran run(const std::vector<std::string>& arguments, const std::string& environment = "") {
    return run_cairn(arguments, "cd '" + folder->path().string() + "'; " + environment);
  }
  static std::vector<std::string> reconstruct(const std::string& recording, const std::string& output,
                                              const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"reconstruct", recording, "-o", output, "--config", "rec.yaml"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    if (std::find(more.begin(), more.end(), "--texture") == more.end()) arguments.emplace_back("--no-texture");
    return arguments;
  }
  static TemporaryFolder* folder;
};
TemporaryFolder* Outputs::folder = nullptr;

TEST_F(Outputs, AcceptAnyFileNameInEveryCommand) {
  // Relative, with a slash, by a detour, with a space, and in another encoding than UTF-8.
  const std::string base = folder->path().filename().string();
  fs::copy(*folder / "rec", *folder / "a b", fs::copy_options::recursive);
  fs::copy(*folder / "rec", *folder / "caf\xe9", fs::copy_options::recursive);
  struct Names {
    std::string recording, output;
    bool all = false;  // test all commands
  };
  for (const auto& [recording, output, all] :
       {Names{"rec", "out1"}, Names{"./a b", "../" + base + "/out 2"}, Names{"./caf\xe9/", "./fen\xeatre/", true}}) {
    SCOPED_TRACE(output);
    const fs::path out = output;
    const auto succeeds = [&](const std::vector<std::string>& arguments, const std::string& environment = "") {
      const Ran ran = run(arguments, environment);
      EXPECT_EQ(ran.exit_code, 0) << arguments[0] << ": " << ran.err;
      return ran;
    };
    succeeds(reconstruct(recording, output, {"--checkpoint", "0"}));
    const Ran again = succeeds(reconstruct(recording, output, {"--resume", "--json"}));
    EXPECT_EQ(nlohmann::json::parse(again.out)["frames"]["total"], 20);  // no frame is fused twice
    EXPECT_TRUE(fs::exists(*folder / out / "report.html"));
    if (!all) continue;
    for (const char* file : {"x.glb", "x.gltf", "x.ply", "x.obj", "tileset.json", "x.vdb"})
      succeeds({"export", output, "-o", (out / file).string()});
    succeeds({"export", output, "-o", (out / "caf\xe9.gltf").string()});
    EXPECT_FALSE(read_mesh(*folder / out / "caf\xe9.gltf").triangles.empty());
    succeeds({"live", recording, "-o", (out / "live").string(), "--as-fast-as-possible", "--config", "rec.yaml",
              "--no-texture"});
    succeeds({"merge", output, (out / "live").string(), "-o", (out / "both/").string(), "--no-texture"});
    succeeds({"esdf", output, "-o", (out / "d.vdb").string(), "--slice", "y=0", (out / "s.png").string(), "--costmap",
              (out / "c.yaml").string(), "--height", "-1:0.3"});
    write_text(*folder / out / "points.csv", "x,y,z\n0,0,1\n");
    succeeds({"esdf", output, "-o", (out / "a.csv").string(), "--query", (out / "points.csv").string()});
    succeeds({"graph", "optimize", (out / "graph.g2o").string(), "-o", (out / "g.g2o").string()});
    succeeds({"evaluate", "trajectory", (out / "trajectory.txt").string(), (out / "trajectory.txt").string()});
    succeeds({"synth", "sphere", "-o", (out / "synth/").string(), "--frames", "1"});
    succeeds({"synth", "sphere", "-o", "synth-caf\xe9", "--frames", "1"});
    EXPECT_NE(run({"view", output, "--port", "0"}, "timeout --foreground -s INT 1").out.find("http"),
              std::string::npos);
    succeeds({"record", "rec", "-o", "recorded-caf\xe9"});
    succeeds({"record", recording, "-o", (out / "recorded/").string()});
  }
}

TEST_F(Outputs, EarlierOutputsStayWhenACommandFails) {
  fs::copy(*folder / "map", *folder / "safe", fs::copy_options::recursive);
  const auto before = bytes_below(*folder / "safe");
  write_text(*folder / "wrong.yaml", "fuse: {voxel_size: 7}\n");
  const auto over = [](std::vector<std::string> more, const char* recording = "rec") {
    more.emplace_back("--overwrite");
    return reconstruct(recording, "safe", more);
  };
  const std::vector<std::pair<std::vector<std::string>, std::string>> failing{
      {over({"--device", "9"}), "device"},
      {over({"--esdf", "--esdf-voxel-size", "0.05"}), "--esdf-voxel-size"},
      {over({"--min-weight", "250"}), "--min-weight"},
      {over({"--simplify", "7"}), "--simplify"},
      {over({"--device-memory", "1"}), "--device-memory"},
      {over({"--texture"}, "long-gray"), "--texture"},
      {over({}, "nowhere"), "nowhere"},
      {reconstruct("rec", "safe", {"--resume", "--voxel-size", "0.02"}), "--voxel-size"},
      {{"reconstruct", "rec", "-o", "safe", "--config", "wrong.yaml", "--overwrite"}, "fuse.voxel_size"},
      {{"live", "rec", "-o", "safe", "--device", "9", "--overwrite"}, "device"},
      {{"live", "openni:nowhere", "-o", "safe", "--overwrite"}, "no depth sensor"},
      {{"merge", "map", "other", "-o", "safe"}, "no session"},
      {{"export", "safe", "-o", "safe/mesh.glb", "--device", "9"}, "device"},
      {{"export", "safe", "-o", "safe/mesh.glb", "--min-weight", "250"}, "no surface is left"},
  };
  for (const auto& [arguments, expected] : failing) {
    expect_last_line(run(arguments), expected == "--simplify" ? 2 : 1, expected);  // out of range: wrong usage
    EXPECT_TRUE(bytes_below(*folder / "safe") == before) << expected;
  }
  // In an empty folder no session remains.
  for (const auto& [arguments, expected] : failing) {
    auto elsewhere = arguments;
    for (auto& a : elsewhere)
      if (a == "safe") a = "empty";
    if (elsewhere[0] != "export") (void)run(elsewhere);
    EXPECT_FALSE(fs::exists(*folder / "empty" / "session")) << expected;
  }
}

TEST_F(Outputs, FinishedMapIsNotOverwrittenByDefault) {
  fs::copy(*folder / "map", *folder / "kept", fs::copy_options::recursive);
  const auto before = bytes_below(*folder / "kept");
  for (const auto& arguments : std::vector<std::vector<std::string>>{
           reconstruct("rec", "kept"), {"reconstruct", "rec", "kept/"}, {"live", "rec", "kept"}}) {
    const Ran ran = run(arguments);
    expect_one_line(ran, 1, "already contains a map (mesh.glb)");
    for (const char* answer : {"--overwrite", "--resume", "--auto-name"})
      EXPECT_NE(ran.err.find(answer), std::string::npos) << ran.err;
  }
  // --resume is not suggested where it does not apply.
  for (const auto& arguments : std::vector<std::vector<std::string>>{
           reconstruct("rec", "kept", {"--poses", "map/trajectory.txt"}), {"merge", "map", "map", "-o", "kept"}}) {
    const Ran ran = run(arguments);
    expect_one_line(ran, 1, "--overwrite to replace it, or --auto-name");
    EXPECT_EQ(ran.err.find("--resume"), std::string::npos) << ran.err;
  }
  EXPECT_TRUE(bytes_below(*folder / "kept") == before);
  // One of its files is sufficient.
  for (const char* name : {"map.vdb", "report.json", "trajectory.txt", "mesh.glb"}) {
    fs::remove_all(*folder / "one");
    fs::create_directory(*folder / "one");
    write_text(*folder / "one" / name, "finished");
    expect_one_line(run(reconstruct("rec", "one")), 1, "(" + std::string(name) + ")");
    EXPECT_EQ(read_bytes(*folder / "one" / name), "finished");
  }
  for (const char* other : {"--resume", "--auto-name"})
    EXPECT_EQ(run(reconstruct("rec", "kept", {"--overwrite", other})).exit_code, 2) << other;
  EXPECT_EQ(run(reconstruct("rec", "kept", {"--resume", "--auto-name"})).exit_code, 2);
}

TEST_F(Outputs, AutoNameUsesTheNextUnusedFolder) {
  fs::copy(*folder / "map", *folder / "named", fs::copy_options::recursive);
  fs::create_directory(*folder / "named-2");
  write_text(*folder / "named-2" / "notes.txt", "mine");
  const auto before = bytes_below(*folder / "named");
  const Ran ran = run({"reconstruct", "rec", "named/", "--auto-name", "--config", "rec.yaml", "--frames", "0:8"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find("named-3 (named/ contains a map)"), std::string::npos) << ran.err;
  EXPECT_NE(ran.out.find("named-3/mesh.glb"), std::string::npos) << ran.out;
  EXPECT_EQ(read_trajectory(*folder / "named-3" / "trajectory.txt").size(), 8u);
  EXPECT_TRUE(bytes_below(*folder / "named") == before);
  EXPECT_EQ(fs::file_size(*folder / "named-2" / "notes.txt"), 4u);
  // An unused name is taken as given, and so is a folder with foreign files, which stay.
  ASSERT_EQ(run(reconstruct("rec", "named-2", {"--auto-name", "--frames", "0:8"})).exit_code, 0);
  EXPECT_TRUE(fs::exists(*folder / "named-2" / "mesh.glb"));
  EXPECT_EQ(read_bytes(*folder / "named-2" / "notes.txt"), "mine");
}

TEST_F(Outputs, InterruptedRunIsResumed) {
  fs::create_directory(*folder / "cut");
  fs::copy(*folder / "map" / "session", *folder / "cut" / "session", fs::copy_options::recursive);
  const auto before = bytes_below(*folder / "cut");
  const Ran ran = run(reconstruct("rec", "cut"));
  expect_one_line(ran, 1, "contains an interrupted run: use --resume");
  for (const char* answer : {"--overwrite", "--auto-name"})
    EXPECT_NE(ran.err.find(answer), std::string::npos) << ran.err;
  EXPECT_TRUE(bytes_below(*folder / "cut") == before);
  const Ran resumed = run(reconstruct("rec", "cut", {"--resume", "--json"}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(nlohmann::json::parse(resumed.out)["frames"]["total"], 20);
  // A run killed before its first checkpoint leaves no session to resume.
  fs::create_directories(*folder / "early" / "session" / "run-0001" / "keyframes");
  EXPECT_EQ(run(reconstruct("rec", "early", {"--frames", "0:8"})).exit_code, 0);
}

TEST_F(Outputs, SynthReplacesRecordingsOnlyWithOverwrite) {
  ASSERT_EQ(run({"synth", "sphere", "-o", "ball", "--frames", "1"}).exit_code, 0);
  write_text(*folder / "ball" / "notes.txt", "mine");
  const auto before = bytes_below(*folder / "ball");
  expect_one_line(run({"synth", "sphere", "-o", "ball", "--frames", "2"}), 1, "--overwrite");
  for (const char* recorder : {"record", "convert"})
    expect_one_line(run({recorder, "rec", "-o", "ball"}), 1, "choose another folder");
  EXPECT_TRUE(bytes_below(*folder / "ball") == before);
  EXPECT_EQ(run({"synth", "sphere", "-o", "ball", "--frames", "2", "--overwrite"}).exit_code, 0);
  EXPECT_TRUE(fs::exists(*folder / "ball" / "depth" / "0.033333.png"));
  EXPECT_EQ(read_bytes(*folder / "ball" / "notes.txt"), "mine");
}

TEST_F(Outputs, AreWrittenIfTheMeshFails) {
  // Too short to detect at the beginning that there is no color.
  const Ran ran = run(reconstruct("gray", "plain", {"--texture"}));
  expect_last_line(ran, 1, "cairn export plain -o plain/mesh.glb");
  EXPECT_NE(ran.err.find("no color"), std::string::npos) << ran.err;
  for (const char* file : {"trajectory.txt", "graph.g2o", "map.vdb", "report.json", "report.html"})
    EXPECT_TRUE(fs::exists(*folder / "plain" / file)) << file;
  EXPECT_FALSE(fs::exists(*folder / "plain" / "mesh.glb"));
  EXPECT_EQ(run({"export", "plain", "-o", "plain/mesh.glb"}).exit_code, 0);
  EXPECT_TRUE(fs::exists(*folder / "plain" / "mesh.glb"));
  // The session is up to the last frame: no work remains.
  const Ran more = run(reconstruct("gray", "plain", {"--resume", "--json"}));
  ASSERT_EQ(more.exit_code, 0) << more.err;
  EXPECT_EQ(nlohmann::json::parse(more.out)["frames"]["total"], 12);
}

TEST_F(Outputs, AreTexturedIfThereIsColor) {
  const auto mesh_of = [&](const std::string& recording, const char* output, std::vector<std::string> more) {
    std::vector<std::string> arguments{"reconstruct", recording, output, "--config", "rec.yaml", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return ran.exit_code == 0 ? nlohmann::json::parse(ran.out)["mesh"] : nlohmann::json{};
  };
  EXPECT_EQ(mesh_of("rec", "t1", {})["textures"], 1);
  EXPECT_EQ(mesh_of("rec", "t2", {"--texture-size", "256"})["textures"], 1);
  EXPECT_FALSE(mesh_of("rec", "t3", {"--no-texture"}).contains("textures"));
  // Without color, and with given poses, a missing texture is no failure and causes no wait.
  EXPECT_FALSE(mesh_of("long-gray", "t4", {}).contains("textures"));
  EXPECT_FALSE(mesh_of("rec", "t5", {"--poses", "map/trajectory.txt"}).contains("textures"));
  EXPECT_EQ(mesh_of("rec", "t6", {"--poses", "map/trajectory.txt", "--texel", "0.01"})["textures"], 1);
  EXPECT_NEAR(mesh_of("rec", "t-coarse", {"--texel", "0.03"})["texel_m"].get<double>(), 0.03, 1e-6);
  EXPECT_EQ(run({"reconstruct", "rec", "t7", "--no-texture", "--texture-size", "256"}).exit_code, 2);
  // The same for a finished map, if the file type supports textures.
  const auto textures_of = [&](const std::string& map, const char* file) {
    const Ran ran = run({"export", map, "-o", file, "--json"});
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return ran.exit_code == 0 ? nlohmann::json::parse(ran.out).value("textures", 0) : -1;
  };
  EXPECT_EQ(textures_of("map", "e.glb"), 1);
  EXPECT_EQ(textures_of("map", "e.obj"), 1);
  EXPECT_EQ(textures_of("map", "e.ply"), 0);
  EXPECT_EQ(textures_of("t4", "e.gltf"), 0);
  EXPECT_EQ(textures_of("map/map.vdb", "f.glb"), 0);
  EXPECT_EQ(run({"export", "t4", "-o", "g.glb", "--texture"}).exit_code, 1);
}

TEST_F(Outputs, ContainTheFramesBeforeADeviceFailure) {
  expect_last_line(run(reconstruct("rec", "stopped"), faulty_device("submit=60")), 1, "--resume continues from there");
  const std::size_t before = read_trajectory(*folder / "stopped/trajectory.txt").size();
  EXPECT_GT(before, 0u);
  EXPECT_LT(before, 20u);
  EXPECT_FALSE(read_mesh(*folder / "stopped/mesh.glb").triangles.empty());
  const Ran resumed = run(reconstruct("rec", "stopped", {"--resume"}));
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(read_trajectory(*folder / "stopped/trajectory.txt").size(), 20u);
}

TEST_F(Outputs, AreNotChangedByReading) {
  const auto before = bytes_below(*folder / "map");
  const std::vector<std::vector<std::string>> reading{
      {"export", "map", "-o", "read/x.glb", "--texture"},
      {"export", "map", "-o", "read/x.vdb"},
      {"esdf", "map", "-o", "read/d.vdb"},
      {"merge", "map", "map", "-o", "read/both", "--no-texture"},
      {"evaluate", "trajectory", "map/trajectory.txt", "rec/../map/trajectory.txt"},
  };
  fs::create_directory(*folder / "read");
  for (const auto& arguments : reading) {
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(bytes_below(*folder / "map") == before) << arguments[0];
  }
}

TEST_F(Outputs, HaveOneWriter) {
  fs::copy(*folder / "map", *folder / "taken", fs::copy_options::recursive);
  const auto before = bytes_below(*folder / "taken");
  {
    const SessionLock lock(*folder / "taken" / "session");
    const std::string who = "another run writes into it (process " + std::to_string(getpid());
    std::vector<std::future<Ran>> waiting;  // each waits some seconds for the lock
    for (const auto& writing : std::vector<std::vector<std::string>>{
             reconstruct("rec", "taken", {"--overwrite"}),
             reconstruct("rec", "taken", {"--resume"}),
             reconstruct("rec", "taken", {"--overwrite", "--poses", "map/trajectory.txt"}),
             {"merge", "map", "map", "-o", "taken", "--overwrite"}})
      waiting.push_back(std::async(std::launch::async, [writing] { return run(writing); }));
    for (auto& ran : waiting) expect_last_line(ran.get(), 1, who);
    EXPECT_EQ(run({"export", "taken", "-o", "beside.glb"}).exit_code, 0);
  }
  EXPECT_TRUE(bytes_below(*folder / "taken") == before);
}

TEST_F(Outputs, GivenPosesReplaceASession) {
  fs::copy(*folder / "map", *folder / "posed", fs::copy_options::recursive);
  write_text(*folder / "posed" / "notes.txt", "mine");
  write_text(*folder / "posed" / "trajectory-000.txt", "of a recording before");
  const Ran ran = run(reconstruct("rec", "posed", {"--overwrite", "--poses", "map/trajectory.txt"}));
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  for (const char* name : {"session", "graph.g2o", "graph.svg", "trajectory-000.txt"})
    EXPECT_FALSE(fs::exists(*folder / "posed" / name)) << name;
  EXPECT_EQ(read_bytes(*folder / "posed" / "notes.txt"), "mine");
}

TEST_F(Outputs, ResumeAMovedRecordingButNotAnotherOne) {
  fs::copy(*folder / "rec", *folder / "here", fs::copy_options::recursive);
  ASSERT_EQ(run(reconstruct("here", "moves", {"--frames", "0:12"})).exit_code, 0);
  fs::rename(*folder / "here", *folder / "there");
  const Ran moved = run(reconstruct("there", "moves", {"--resume", "--json"}));
  ASSERT_EQ(moved.exit_code, 0) << moved.err;
  EXPECT_EQ(nlohmann::json::parse(moved.out)["frames"]["total"], 20);
  EXPECT_TRUE(read_bytes(*folder / "moves" / "mesh.glb").size() > 0);
  EXPECT_FALSE(fs::exists(*folder / "moves" / "trajectory-000.txt"));  // one recording
  EXPECT_TRUE(read_bytes(*folder / "moves" / "trajectory.txt") == read_bytes(*folder / "map" / "trajectory.txt"));
  // Other footage under the same name starts at its first frame, as another recording.
  fs::remove_all(*folder / "there");
  fs::copy(*folder / "other", *folder / "there", fs::copy_options::recursive);
  const Ran other = run(reconstruct("there", "moves", {"--resume", "--json"}));
  // The small images of a corridor may or may not be recognized as another place; both are accepted.
  const bool is_none = other.exit_code == 1 && other.err.find("none of 12 frames") != std::string::npos;
  EXPECT_TRUE(is_none || other.exit_code == 0) << other.err;
  if (!is_none) {
    EXPECT_EQ(nlohmann::json::parse(other.out)["frames"]["total"], 12);
  }
}

TEST_F(Outputs, FullStdoutIsAnError) {
  const std::string in = "cd '" + folder->path().string() + "'; '" + program_file().string() + "' ";
  for (const char* command :
       {"--help", "--version", "devices", "export map -o full.ply", "export map -o full.ply --json",
        "evaluate trajectory map/trajectory.txt map/trajectory.txt"}) {
    const int status = std::system((in + command + " >/dev/full 2>full.txt").c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1) << command;
    const std::string output = read_bytes(*folder / "full.txt");
    EXPECT_NE(output.find("stdout: No space left on device"), std::string::npos) << command << output;
    const std::size_t error = output.find("cairn: ");  // long commands print progress before
    EXPECT_EQ(output.find('\n', error), output.size() - 1) << output;
  }
}

TEST_F(Outputs, ErrorsDoNotNameTheJsonLibrary) {
  fs::create_directories(*folder / "bad" / "depth");
  fs::copy_file(fs::directory_iterator(*folder / "rec" / "depth")->path(), *folder / "bad" / "depth" / "0.png");
  for (const char* text : {"{", "[]", "{\"width\": \"wide\"}"}) {
    write_text(*folder / "bad" / "intrinsics.json", text);
    for (const auto& arguments : {reconstruct("bad", "x"), {"evaluate", "loops", "bad/intrinsics.json", "rec"}}) {
      const Ran ran = run(arguments);
      EXPECT_EQ(ran.exit_code, 1) << ran.err;
      EXPECT_EQ(ran.err.find("json.exception"), std::string::npos) << ran.err;
      EXPECT_NE(ran.err.find("intrinsics.json"), std::string::npos) << ran.err;
    }
  }
}

}  // namespace
}  // namespace cairn
