// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Runs with disk errors, and killed runs. scripts/campaign faults and scripts/campaign kill run the same tests with
// CAIRN_FAULTS_EVERY=3, alternating three kinds so that each operation fails once, and with CAIRN_KILLS=N.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <sstream>
#include <thread>

#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/pose_graph.hpp"
#include "io/ros/ros_recording.hpp"
#include "session/session_files.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Small recording that returns to its start, its results, and an older map.
class DisturbedRun : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    write_small_recording(*folder / "rec", {.frames = 40, .speed = 4, .turns_at = 2.6});
    write_small_recording(*folder / "old", {.frames = 12, .scene = "corridor"});
    ASSERT_EQ(run_cairn(reconstruct("rec", *folder / "good")).exit_code, 0);
    ASSERT_EQ(run_cairn(reconstruct("old", *folder / "before")).exit_code, 0);
    const auto report = nlohmann::json::parse(read_bytes(*folder / "good" / "report.json"));
    EXPECT_GT(report["submaps"]["ended"], 1);
    EXPECT_GT(report["loops"].size(), 0u);
    EXPECT_EQ(report["frames"]["fused"], 40);
    // The run above was validated; the following runs repeat it.
    setenv("CAIRN_VALIDATION", "0", 1);
  }
  static void TearDownTestSuite() {
    setenv("CAIRN_VALIDATION", "1", 1);
    delete folder;
  }
  static std::vector<std::string> reconstruct(const std::string& recording, const fs::path& output,
                                              const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"reconstruct",   "--no-texture", (*folder / recording).string(), "-o",
                                       output.string(), "--config",     (*folder / "rec.yaml").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  /// Differences from the undisturbed run.
  static std::string differences(const fs::path& output) {
    std::string different;
    for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt", "graph.g2o"})
      if (!fs::exists(output / file) || read_bytes(output / file) != read_bytes(*folder / "good" / file))
        different += std::string(file) + " ";
    return different;
  }
  static TemporaryFolder* folder;
  TemporaryFolder out;
};
TemporaryFolder* DisturbedRun::folder = nullptr;

class Faults : public DisturbedRun {
 protected:
  [[nodiscard]] std::string disk(const fs::path& watched, int at, const std::string& kind) const {
    return "CAIRN_FAULTS_FOLDER='" + watched.string() + "' CAIRN_FAULTS_AT=" + std::to_string(at) +
           " CAIRN_FAULTS_KIND=" + kind + " CAIRN_FAULTS_LOG='" + (out / "log").string() +
           "' LD_PRELOAD=\"$LD_PRELOAD:\"'" + faults_library() + "'";
  }
  /// Operations of the last program, one per line.
  [[nodiscard]] std::vector<std::string> operations() const {
    std::vector<std::string> lines;
    std::istringstream in(read_bytes(out / "log"));
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
  }
  [[nodiscard]] int count() const {
    const auto lines = operations();
    return static_cast<int>(
        std::count_if(lines.begin(), lines.end(), [](const auto& line) { return !line.starts_with("unlink"); }));
  }
  /// Expects complete files only, without temporary files.
  static void expect_whole(const fs::path& output, const std::string& when) {
    for (const auto& entry : fs::recursive_directory_iterator(output)) {
      const fs::path& file = entry.path();
      EXPECT_FALSE(file.filename().string().starts_with(".cairn")) << when << file;
      EXPECT_FALSE(file.filename().string().starts_with(".part")) << when << file;
      const std::string extension = file.extension().string();
      EXPECT_NO_THROW({
        if (extension == ".glb") {
          EXPECT_FALSE(read_mesh(file).triangles.empty()) << when;
        }
        if (file.filename() == "map.vdb") {
          EXPECT_GT(read_grids(file).tree.size(), 0u) << when;
        }
        if (file.filename().string().starts_with("trajectory")) {
          EXPECT_FALSE(read_trajectory(file).empty());
        }
        if (extension == ".g2o") {
          EXPECT_FALSE(read_g2o(file).edges.empty());
        }
        if (extension == ".json") {
          EXPECT_TRUE(nlohmann::json::accept(read_bytes(file)));
        }
        if (extension == ".html") {
          EXPECT_NE(read_bytes(file).find("</html>"), std::string::npos) << when;
        }
      }) << when
         << file;
    }
  }
  static void expect_told(const Ran& ran, const std::string& when) {
    EXPECT_TRUE(ran.exit_code == 0 || ran.exit_code == 1) << when << ran.exit_code << ran.err;
    EXPECT_EQ(ran.err.find("json.exception"), std::string::npos) << when << ran.err;
    if (ran.exit_code == 0) return;
    const std::size_t begin = ran.err.rfind('\n', ran.err.size() - 2);
    const std::string last = ran.err.substr(begin == ran.err.npos ? 0 : begin + 1);
    EXPECT_TRUE(last.starts_with("cairn: ")) << when << ran.err;
    EXPECT_TRUE(last.find("No space left") != last.npos || last.find("Input/output error") != last.npos)
        << when << last;
  }
};

/// A full disk, a disk with errors, and a disk with short writes.
constexpr std::string_view kKinds[] = {"full", "eio", "short"};
class FaultsOfARun : public Faults, public testing::WithParamInterface<std::string_view> {};

TEST_P(FaultsOfARun, LoseNothingWhateverFails) {
  const std::string kind(GetParam());
  // After every frame: all runs are identical.
  const std::vector<std::string> often{"--checkpoint", "0", "--overwrite"};
  static int operations = 0;  // of a run without faults
  if (operations == 0) {
    fs::copy(*folder / "before", out / "map", fs::copy_options::recursive);
    ASSERT_EQ(run_cairn(reconstruct("rec", out / "map", often), disk(out / "map", 0, "eio")).exit_code, 0);
    operations = count();
  }
  ASSERT_GT(operations, 60);
  const auto old_session = bytes_below(*folder / "before" / "session");
  const int step = number_from("CAIRN_FAULTS_EVERY", std::max(1, operations / 3));
  // The three kinds start at different operations, so that with a step of three each operation fails once.
  const auto first =
      static_cast<int>(std::find(std::begin(kKinds), std::end(kKinds), kind) - std::begin(kKinds)) % step;
  int failed = 0, old = 0, resumed = 0, known = 0, runs = 0;
  std::set<std::map<std::string, std::string>> resumed_from;
  for (int n = first + 1; n <= operations; n += step) {
    ++runs;
    const std::string when = kind + " at " + std::to_string(n) + ": ";
    fs::remove_all(out / "map");
    fs::remove(out / "log");
    fs::copy(*folder / "before", out / "map", fs::copy_options::recursive);
    const Ran ran = run_cairn(reconstruct("rec", out / "map", often), disk(out / "map", n, kind));
    expect_told(ran, when);
    if (kind == "short") {
      EXPECT_EQ(ran.exit_code, 0) << when << ran.err;
    }
    failed += ran.exit_code != 0;
    expect_whole(out / "map", when);
    ASSERT_TRUE(fs::exists(out / "map" / "session" / "state.cbor")) << when << ran.err;
    EXPECT_FALSE(fs::exists(out / "map" / "session" / "lock")) << when;
    auto session = bytes_below(out / "map" / "session");
    if (session == old_session) {
      ++old;
      EXPECT_EQ(ran.exit_code, 1) << when;
      continue;
    }
    // Runs resumed from the same bytes have the same result, as shown by runs without faults.
    if (!resumed_from.insert(std::move(session)).second) {
      ++known;
      continue;
    }
    const Ran again = run_cairn(reconstruct("rec", out / "map", {"--resume"}));
    ++resumed;
    EXPECT_EQ(again.exit_code, 0) << when << again.err << "after " << ran.err;
    EXPECT_EQ(differences(out / "map"), "") << when;
  }
  std::printf(
      "%d operations, %d runs with one that failed (%s): %d told it, %d left the old session, %d another, %d of them "
      "different and resumed\n",
      operations, runs, kind.c_str(), failed, old, resumed + known, resumed);
}

INSTANTIATE_TEST_SUITE_P(Disk, FaultsOfARun, testing::ValuesIn(kKinds),
                         [](const auto& parameter) { return std::string(parameter.param); });

TEST_F(Faults, AnyOperationOfAnExportMayFail) {
  const auto session = bytes_below(*folder / "good");
  const int every = number_from("CAIRN_FAULTS_EVERY", 8);
  int operations = 0, runs = 0;
  for (const char* file : {"x.glb", "x.obj", "tileset.json", "x.vdb"}) {
    const std::vector<std::string> arguments{"export", (*folder / "good").string(), "-o", (out / "to" / file).string(),
                                             "--no-texture"};
    fs::remove(out / "log");
    ASSERT_EQ(run_cairn(arguments, disk(out / "to", 0, "eio")).exit_code, 0);
    const int last = count();
    operations += last;
    for (const char* kind : {"full", "eio"})
      for (int n = 1 + runs % every; n <= last; n += every) {  // alternating two kinds and four files
        ++runs;
        fs::remove_all(out / "to");
        const std::string when = std::string(file) + ", " + kind + " at " + std::to_string(n) + ": ";
        const Ran ran = run_cairn(arguments, disk(out / "to", n, kind));
        expect_told(ran, when);
        if (fs::exists(out / "to")) expect_whole(out / "to", when);
        EXPECT_TRUE(ran.exit_code == 1 || fs::exists(out / "to" / file)) << when;
      }
    fs::remove_all(out / "to");
  }
  EXPECT_TRUE(bytes_below(*folder / "good") == session);
  std::printf("%d operations of four exports, %d runs with one that failed\n", operations, runs);
}

/// Also on a disk without atomic exchange of two folders.
TEST_F(Faults, AnyOperationMayFailThatReplacesARecording) {
  const auto synth = [&](const char* frames) {
    return std::vector<std::string>{
        "synth", "sphere", "-o", (out / "to" / "ball").string(), "--frames", frames, "--width", "64", "--overwrite"};
  };
  ASSERT_EQ(run_cairn(synth("1")).exit_code, 0);
  write_text(out / "to" / "ball" / "notes.txt", "mine");
  fs::copy(out / "to", out / "old", fs::copy_options::recursive);
  const auto old = bytes_below(out / "old");
  int runs = 0, kept = 0;
  for (const std::string exchange : {"yes", "no"}) {
    const auto failing = [&](int n, const char* kind) {
      return "CAIRN_FAULTS_EXCHANGE=" + exchange + " " + disk(out / "to", n, kind);
    };
    fs::remove(out / "log");
    ASSERT_EQ(run_cairn(synth("2"), failing(0, "eio")).exit_code, 0);
    const int last = count(), every = number_from("CAIRN_FAULTS_EVERY", 6);
    for (const char* kind : {"full", "eio"})
      for (int n = 1; n <= last; n += n + 8 > last ? 1 : every) {  // each of the last operations, which move the
                                                                   // folders
        ++runs;
        const std::string when = kind + (" at " + std::to_string(n)) + ", exchange: " + exchange + ": ";
        fs::remove_all(out / "to");
        fs::copy(out / "old", out / "to", fs::copy_options::recursive);
        const Ran ran = run_cairn(synth("2"), failing(n, kind));
        EXPECT_TRUE(ran.exit_code == 0 || ran.err.find("cairn: ") != ran.err.npos) << when << ran.err;
        const auto now = bytes_below(out / "to");
        EXPECT_EQ(now.at("ball/notes.txt"), "mine") << when;
        EXPECT_TRUE(ran.exit_code == 0 ? now.contains("ball/depth/0.033333.png") : now == old) << when << ran.err;
        expect_whole(out / "to", when);
        kept += now == old;
      }
  }
  EXPECT_GT(kept, 10);
  std::printf("%d runs with an operation that failed, %d left the old recording\n", runs, kept);
}

TEST_F(Faults, ALogThatCannotBeWrittenEndsAndTheMapGoesOn) {
  const fs::path logs = out / "logs", log = logs / "x.mcap";
  fs::create_directories(logs);
  const auto logged = [&](const std::string& name) { return reconstruct("rec", out / name, {"--log", log.string()}); };
  ASSERT_EQ(run_cairn(logged("map"), disk(logs, 0, "eio")).exit_code, 0);
  EXPECT_EQ(differences(out / "map"), "");
  const int last = count();
  ASSERT_GT(last, 3);
  for (int n = 1; n <= last; ++n) {
    const std::string when = "at " + std::to_string(n) + ": ";
    fs::remove(log);
    fs::remove_all(out / "map");
    const Ran ran = run_cairn(logged("map"), disk(logs, n, n % 2 == 0 ? "full" : "eio"));
    EXPECT_NE(ran.err.find("cannot write " + log.string() + ": "), std::string::npos) << when << ran.err;
    EXPECT_EQ(ran.exit_code, n <= 2 ? 1 : 0) << when << ran.err;  // its first bytes are written before any work
    if (n <= 2) continue;
    EXPECT_NE(ran.err.find("logging stops, mapping continues"), std::string::npos) << when << ran.err;
    EXPECT_EQ(differences(out / "map"), "") << when;
    if (n == last) continue;  // the summary: all data before is complete, with the end of the data
    const auto rest = open_mcap(log);
    while (rest->next()) continue;
    const std::string size = std::to_string(fs::file_size(log));  // ends with a complete record
    EXPECT_NE(rest->ended_early().value_or("").find("at byte " + size + " of " + size), std::string::npos) << when;
  }
}

TEST_F(DisturbedRun, KeepsTheLogOfThePreviousRunIfResumed) {
  const fs::path log = out / "x.mcap";
  ASSERT_EQ(run_cairn(reconstruct("rec", out / "map", {"--log", log.string()})).exit_code, 0);
  const std::string before = read_bytes(log);
  const Ran ran = run_cairn(reconstruct("rec", out / "map", {"--log", log.string(), "--resume"}));
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find((out / "x-2.mcap").string()), std::string::npos) << ran.err;
  EXPECT_TRUE(fs::exists(out / "x-2.mcap"));
  EXPECT_TRUE(read_bytes(log) == before);
  expect_one_line(run_cairn(reconstruct("rec", out / "new", {"--log", log.string()})), 1,
                  "exists; choose another name");
  expect_one_line(run_cairn(reconstruct("rec", out / "new", {"--log", "x.bag"})), 1, "a name that ends in .mcap");
  EXPECT_FALSE(fs::exists(out / "new" / "map.vdb"));
}

TEST_F(Faults, AFileIsOnTheDiskBeforeItHasItsName) {
  const fs::path map = out / "map";
  ASSERT_EQ(run_cairn(reconstruct("rec", map, {"--checkpoint", "0.2"}), disk(map, 0, "eio")).exit_code, 0);
  const auto lines = operations();
  int renamed = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (!lines[i].starts_with("rename ")) continue;
    const fs::path file = lines[i].substr(7);
    ++renamed;
    if (file.parent_path().filename() == "keyframes") {  // written together before a state names them
      const auto rest = lines.begin() + static_cast<std::ptrdiff_t>(i);
      // A state from before this keyframe may follow directly; a state that names the keyframe follows the bricks of
      // its time.
      const auto bricks =
          std::find_if(rest, lines.end(), [](const auto& line) { return line.find("/active-") != line.npos; });
      const auto state = std::find(bricks, lines.end(), "rename " + (map / "session" / "state.cbor").string());
      EXPECT_TRUE(std::any_of(rest, state, [](const auto& line) { return line.starts_with("syncfs "); })) << file;
      continue;
    }
    const std::string temporary = "/.cairn-", synced = "fsync ";
    bool before = false, after = false;
    for (std::size_t j = i; j-- > 0 && !before;)
      before = lines[j].starts_with(synced) && lines[j].find(temporary) != std::string::npos &&
               lines[j].ends_with("." + file.filename().string()) &&
               fs::path(lines[j].substr(6)).parent_path() == file.parent_path();
    for (std::size_t j = i; j < lines.size() && !after; ++j) after = lines[j] == synced + file.parent_path().string();
    EXPECT_TRUE(before) << file;
    EXPECT_TRUE(after) << file;
  }
  EXPECT_GT(renamed, 20);
  // The bricks of the previous checkpoint are removed after the new state is on disk.
  for (std::size_t i = 0; i < lines.size(); ++i)
    if (lines[i].starts_with("unlink ") && lines[i].find("/active-") != std::string::npos) {
      std::size_t state = i;
      while (state > 0 && lines[state] != "rename " + (map / "session" / "state.cbor").string()) --state;
      EXPECT_NE(std::find(lines.begin() + static_cast<std::ptrdiff_t>(state),
                          lines.begin() + static_cast<std::ptrdiff_t>(i), "fsync " + (map / "session").string()),
                lines.begin() + static_cast<std::ptrdiff_t>(i));
    }
}

class Kills : public DisturbedRun {
 protected:
  /// Runs the program and kills it after `seconds`. Returns its exit code, or nullopt if killed.
  static std::optional<int> run_and_kill(const std::vector<std::string>& arguments, double seconds,
                                         const fs::path& err) {
    const std::string program = program_file();
    std::vector<char*> argv{const_cast<char*>(program.c_str())};
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    pid_t process = 0;
    const int spawned = posix_spawn(&process, program.c_str(), &files, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (spawned != 0) return -1;
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    int status = 0;
    while (waitpid(process, &status, WNOHANG) == 0) {
      if (std::chrono::steady_clock::now() >= end) {
        kill(process, SIGKILL);
        waitpid(process, &status, 0);
        break;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    if (WIFEXITED(status)) return WEXITSTATUS(status);
    return WTERMSIG(status) == SIGKILL ? std::nullopt : std::optional(1000 + WTERMSIG(status));
  }
};

TEST_F(Kills, AtAnyMomentEndWithTheSameBytes) {
  const int wanted = number_from("CAIRN_KILLS", 4);
  const auto begin = std::chrono::steady_clock::now();
  fs::create_directory(out / "try");
  ASSERT_EQ(run_and_kill(reconstruct("rec", out / "try", {"--checkpoint", "0.05"}), 1e9, out / "err"), 0)
      << read_bytes(out / "err");
  const double whole = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::mt19937 random(static_cast<unsigned>(number_from("CAIRN_SEED", 1)));
  int kills = 0, resumes = 0, finished = 0, different = 0;
  const fs::path map = out / "map";
  while (kills < wanted || resumes < wanted || finished == 0) {
    const bool resume = fs::exists(map / "session" / "state.cbor");
    std::vector<std::string> more{"--checkpoint", "0.05"};
    if (resume) more.emplace_back("--resume");
    const double seconds =
        kills < wanted || resumes < wanted ? std::uniform_real_distribution<>(0.05, 1.2 * whole)(random) : 1e9;
    const auto ended = run_and_kill(reconstruct("rec", map, more), seconds, out / "err");
    resumes += resume;
    if (!ended) {
      ++kills;
      continue;
    }
    ++finished;
    EXPECT_EQ(*ended, 0) << read_bytes(out / "err");
    const std::string differs = differences(map);
    EXPECT_EQ(differs, "");
    different += !differs.empty();
    for (const auto& entry : fs::recursive_directory_iterator(map))
      EXPECT_FALSE(entry.path().filename().string().starts_with(".cairn")) << entry.path();
    fs::remove_all(map);
  }
  std::printf("%d kills, %d resumes, %d finished runs compared byte by byte with the one without kills, %d different\n",
              kills, resumes, finished, different);
}

}  // namespace
}  // namespace cairn
