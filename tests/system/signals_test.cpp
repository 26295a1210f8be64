// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// SIGINT, SIGTERM and SIGHUP at every stage of a run. Blocking files hold the stage, so that no test depends on the
// machine's load.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "support/recordings.hpp"
#include "support/running.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Words = std::vector<std::string>;

constexpr int kInterrupted = 130;

class Signals : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = std::make_unique<TemporaryFolder>();
    write_small_recording(*folder / "rec", {.frames = 60});
  }
  static void TearDownTestSuite() { folder.reset(); }

  static std::set<std::string> names_in(const fs::path& where) {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(where))
      names.insert(fs::relative(entry.path(), where).string());
    return names;
  }
  /// Copy of the recording with a depth image, by number, that blocks its reader.
  static std::unique_ptr<Blocking> block_frame(const std::string& copy, std::size_t number) {
    fs::remove_all(*folder / copy);
    fs::copy(*folder / "rec", *folder / copy, fs::copy_options::recursive);
    std::vector<fs::path> images;
    for (const auto& entry : fs::directory_iterator(*folder / copy / "depth")) images.push_back(entry.path());
    std::sort(images.begin(), images.end());
    return std::make_unique<Blocking>(images.at(number));
  }
  static void expect_ended(const Ran& ran, const std::string& what) {
    EXPECT_EQ(ran.exit_code, kInterrupted) << ran.err;
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << ran.err;
    EXPECT_NE(ran.err.find(what), std::string::npos) << ran.err;
    EXPECT_EQ(ran.out, "");
  }
  static Words mapping(const std::string& command, const std::string& recording, Words more = {}) {
    Words words{command, recording, "-o", "map", "--no-texture", "--config", "rec.yaml"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  static std::unique_ptr<TemporaryFolder> folder;
};
std::unique_ptr<TemporaryFolder> Signals::folder;

TEST_F(Signals, EndEveryCommandAtOnceWhileItReadsItsInput) {
  for (const char* sub : {"session", "plan"}) fs::create_directories(*folder / "held" / sub);
  struct Case {
    Words words;
    const char* held;
  };
  const Case cases[] = {
      {{"reconstruct", "rec", "-o", "map", "--config", "held/o.yaml"}, "held/o.yaml"},
      {{"live", "rec", "-o", "map", "--config", "held/o.yaml"}, "held/o.yaml"},
      {{"synth", "room", "-o", "made", "--trajectory", "held/path.txt"}, "held/path.txt"},
      {{"evaluate", "trajectory", "held/path.txt", "rec"}, "held/path.txt"},
      {{"graph", "optimize", "held/x.g2o", "-o", "made.g2o"}, "held/x.g2o"},
      {{"merge", "held", "rec", "-o", "made"}, "held/session/state.cbor"},
      {{"export", "held", "-o", "made.glb"}, "held/session/state.cbor"},
      {{"convert", "blocked", "-o", "made"}, ""},
      {{"info", "blocked"}, ""},
      {{"reconstruct", "blocked", "-o", "map"}, ""},
      {{"bench", "blocked"}, ""},
  };
  for (const auto& [words, held] : cases)
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
      const bool is_frame = *held == '\0';
      const auto blocking = is_frame ? block_frame("blocked", 0) : std::make_unique<Blocking>(*folder / held);
      const auto before = names_in(folder->path());
      Running program(words, folder->path());
      ASSERT_TRUE(program.wait_until([&] { return blocking->holds_a_reader(); })) << words[0] << program.err();
      program.send(signal);
      expect_ended(program.end(), "interrupted before completion");
      EXPECT_EQ(names_in(folder->path()), before) << words[0];
      fs::remove_all(*folder / (is_frame ? "blocked" : held));
      if (is_frame || signal == SIGHUP) fs::create_directories(*folder / "held" / "session");
    }
}

TEST_F(Signals, AreHandledFromTheFirstLineOfMain) {
  for (const char* command : {"reconstruct", "live"}) {
    const auto before = names_in(folder->path());
    Running program(mapping(command, "rec"), folder->path());
    ASSERT_TRUE(program.wait_until([&] { return program.handles_signals(); }));
    program.send(SIGINT);
    const Ran ran = program.end();
    // On a slow machine the program may be past its first frames.
    EXPECT_TRUE(ran.exit_code == kInterrupted || ran.exit_code == 0) << ran.exit_code << ran.err;
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << ran.err;
    if (ran.exit_code == kInterrupted) {
      EXPECT_EQ(names_in(folder->path()), before);
    }
    fs::remove_all(*folder / "map");
  }
}

TEST_F(Signals, LeaveNoFilesWithoutACheckpoint) {
  for (const char* command : {"reconstruct", "live"}) {
    const auto blocking = block_frame("stuck", 20);
    const auto before = names_in(folder->path());
    Running program(mapping(command, "stuck", {"--checkpoint", "1h"}), folder->path());
    ASSERT_TRUE(program.wait_until([&] { return blocking->holds_a_reader(); })) << program.err();
    // The frames before the blocked frame are fused meanwhile.
    ASSERT_TRUE(program.wait_until([&] { return fs::exists(*folder / "map/session/run-0001"); }));
    program.send(SIGINT);
    program.send(SIGINT);
    if (!program.wait_until([&] { return program.err().find('\n') != std::string::npos; })) FAIL();
    program.send(SIGINT);  // whichever signal counted as the first
    const Ran ran = program.end();
    EXPECT_EQ(ran.exit_code, kInterrupted) << ran.err;
    EXPECT_NE(ran.err.find("interrupted before "), std::string::npos) << ran.err;
    EXPECT_EQ(names_in(folder->path()), before) << command;
    fs::remove_all(*folder / "stuck");
    const Ran again = Running(mapping(command, "rec"), folder->path()).end();
    EXPECT_EQ(again.exit_code, 0) << again.err;
    fs::remove_all(*folder / "map");
  }
}

TEST_F(Signals, KeepTheLastCheckpoint) {
  const auto blocking = block_frame("stuck", 30);
  std::optional<Running> program(std::in_place, mapping("reconstruct", "stuck", {"--checkpoint", "0"}), folder->path());
  ASSERT_TRUE(program->wait_until([&] { return fs::exists(*folder / "map/session/state.cbor"); })) << program->err();
  ASSERT_TRUE(program->wait_until([&] { return blocking->holds_a_reader(); })) << program->err();
  program->send(SIGTERM);
  ASSERT_TRUE(
      program->wait_until([&] { return program->err().find("interrupt again to end at once") != std::string::npos; }));
  program->send(SIGTERM);
  const Ran ran = program->end();
  EXPECT_EQ(ran.exit_code, kInterrupted) << ran.err;
  EXPECT_NE(ran.err.find("resume with: "), std::string::npos) << ran.err;
  fs::remove_all(*folder / "stuck");
  fs::copy(*folder / "rec", *folder / "stuck", fs::copy_options::recursive);
  const Ran resumed = Running(mapping("reconstruct", "stuck", {"--resume"}), folder->path()).end();
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(Json::parse(read_bytes(*folder / "map/report.json"))["frames"]["total"], 60);
  for (const char* made : {"map", "stuck"}) fs::remove_all(*folder / made);
}

TEST_F(Signals, EndTheCurrentStageAndWriteAllFiles) {
  ASSERT_EQ(Running(mapping("reconstruct", "rec", {"--adjust"}), folder->path()).end().exit_code, 0);
  const std::string bent = read_bytes(*folder / "map/map.vdb");
  for (const auto& [words, stage] : {std::pair("reintegrating", "reintegrate"), {"adjusting", "adjust"}}) {
    std::optional<Json> report;
    for (int i = 0; i < 5 && !report; ++i) {  // until the signal arrives before the end of the stage
      fs::remove_all(*folder / "map");
      Running program(mapping("reconstruct", "rec", {"--reintegrate"}), folder->path(), Running::Errors::to_terminal);
      if (!program.wait_until([&] { return program.err().find(words) != std::string::npos; })) continue;
      program.send(SIGINT);
      const Ran ran = program.end();
      ASSERT_EQ(ran.exit_code, 0) << ran.err;
      const Json current = Json::parse(read_bytes(*folder / "map/report.json"));
      if (!current.contains("interrupted")) continue;
      report = current;
      EXPECT_NE(ran.err.find("interrupt again to end at once"), std::string::npos) << ran.err;
      EXPECT_NE(ran.out.find(std::string("interrupted in the stage ") + stage + "; resume with: "), std::string::npos)
          << ran.out;
      EXPECT_NE(ran.out.find("--reintegrate --resume"), std::string::npos) << ran.out;
      for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt", "report.html"})
        EXPECT_TRUE(fs::exists(*folder / "map" / file)) << file;
    }
    ASSERT_TRUE(report) << stage;
    EXPECT_EQ((*report)["interrupted"]["stage"], stage);
    if (std::string(stage) != "reintegrate") continue;
    EXPECT_TRUE(read_bytes(*folder / "map/map.vdb") == bent) << "the map is not the adjusted map";
    EXPECT_NE((*report)["warnings"].dump().find("interrupted; frames are not re-integrated"), std::string::npos);
  }
}

TEST_F(Signals, DuringTrackingSkipTheLaterStages) {
  fs::remove_all(*folder / "map");
  write_small_recording(*folder / "long", {.frames = 250});
  Running program(mapping("reconstruct", "long", {"--reintegrate"}), folder->path());
  const fs::path keyframes = *folder / "map/session/run-0001/keyframes";
  ASSERT_TRUE(program.wait_until([&] {
    return fs::exists(keyframes) && std::distance(fs::directory_iterator(keyframes), fs::directory_iterator()) > 5;
  }));
  program.send(SIGHUP);
  const Ran ran = program.end();
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const Json report = Json::parse(read_bytes(*folder / "map/report.json"));
  EXPECT_LT(report["frames"]["total"], 250);
  for (const char* stage : {"refined", "adjusted"}) EXPECT_FALSE(report.contains(stage)) << stage;
  EXPECT_TRUE(fs::exists(*folder / "map/mesh.glb"));
  fs::remove_all(*folder / "map");
}

}  // namespace
}  // namespace cairn
