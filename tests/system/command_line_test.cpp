// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Input of a new user, right or wrong: the message names the remedy.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Commands with an action, as listed by the program.
const std::vector<std::vector<std::string>> kCommands{{"demo"},
                                                      {"doctor"},
                                                      {"reconstruct"},
                                                      {"live"},
                                                      {"record"},
                                                      {"view"},
                                                      {"export"},
                                                      {"esdf"},
                                                      {"merge"},
                                                      {"plan"},
                                                      {"info"},
                                                      {"convert"},
                                                      {"calibrate"},
                                                      {"synth"},
                                                      {"bench"},
                                                      {"evaluate", "trajectory"},
                                                      {"evaluate", "mesh"},
                                                      {"graph", "optimize"},
                                                      {"devices"},
                                                      {"help"},
                                                      {"completion"}};

/// Output of a shell command; fails the test on an error.
std::string shell(const std::string& command) {
  const TemporaryFolder folder;
  const int status = std::system((command + " >'" + (folder / "out").string() + "' 2>&1").c_str());
  EXPECT_EQ(status, 0) << command << "\n" << read_bytes(folder / "out");
  return read_bytes(folder / "out");
}

bool is_installed(const std::string& program) {
  return std::system(("command -v " + program + " >/dev/null").c_str()) == 0;
}

std::string completion_of(const std::string& sh) {
  const Ran ran = run_cairn({"completion", sh});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  return ran.out;
}

class CommandLine : public testing::Test {
 protected:
  void expect_refused(const std::vector<std::string>& arguments, const std::string& remedy, int exit_code = 2) const {
    const Ran ran = run_cairn(arguments, "cd '" + out.path().string() + "';");
    expect_one_line(ran, exit_code, remedy);
    EXPECT_EQ(ran.out, "");
  }
  TemporaryFolder out;
};

TEST_F(CommandLine, PrintsFiveLinesWithoutArgumentsAtAnyTerminalWidth) {
  for (const int columns : {120, 80, 60, 40}) {
    const Ran ran = run_cairn({}, fmt::format("COLUMNS={}", columns));
    EXPECT_EQ(ran.exit_code, 0);
    EXPECT_EQ(std::count(ran.out.begin(), ran.out.end(), '\n'), 5);
    for (const char* command : {"cairn demo", "cairn reconstruct", "cairn live openni:", "cairn doctor", "cairn help"})
      EXPECT_NE(ran.out.find(command), std::string::npos) << command;
    std::istringstream lines(ran.out);
    for (std::string line; std::getline(lines, line);)
      EXPECT_LE(line.size(), static_cast<std::size_t>(columns)) << line;
  }
}

TEST_F(CommandLine, SuggestsTheNearestCommand) {
  expect_refused({"reconstrct", "x", "-o", "y"},
                 "there is no command reconstrct; did you mean reconstruct? See `cairn --help`");
  expect_refused({"exprot"}, "did you mean export? See");
  expect_refused({"rec"}, "did you mean reconstruct or record?");
  expect_refused({"dance"}, "cairn: there is no command dance; see `cairn --help`");
  expect_refused({"evaluate", "mehs"}, "cairn evaluate: there is no command mehs; did you mean mesh?");
  expect_refused({"evaluate"}, "choose a command: trajectory, mesh");
  expect_refused({"help", "reconstrct"}, "did you mean reconstruct?");
}

TEST_F(CommandLine, SuggestsTheNearestOption) {
  expect_refused({"reconstruct", "x", "-o", "y", "--voxelsize", "0.02"}, "--voxelsize; did you mean --voxel-size?");
  expect_refused({"reconstruct", "x", "-o", "y", "--voxelsize=0.02"}, "did you mean --voxel-size?");
  expect_refused({"export", "x", "-o", "y", "--Texture-Siz", "512"}, "did you mean --texture-size?");
  expect_refused({"--verson"}, "did you mean --version? See `cairn --help`");
  expect_refused({"info", "x", "-z"}, "there is no option -z; see `cairn info --help`");
}

TEST_F(CommandLine, SuggestsTheNearestValueAndFile) {
  expect_refused({"synth", "rooom", "-o", "x"}, "SCENE rooom: choose room, room-with-mover");
  expect_refused({"synth", "rooom", "-o", "x"}, "did you mean room?");
  expect_refused({"synth", "room", "-o", "x", "--noise", "kinekt"},
                 "--noise kinekt: choose kinect, tof, stereo, lidar or none; did you mean kinect?");
  expect_refused({"completion", "csh"}, "SHELL csh: choose bash, zsh or fish; did you mean zsh?");
  write_text(out / "camera.yaml", "");
  expect_refused({"info", "x", "--camera", "camera.yml"},
                 "--camera camera.yml: there is no such file; did you mean camera.yaml?");
  expect_refused({"info", "x", "--camera", "nowhere/camera.yaml"}, "there is no folder nowhere");
  expect_refused({"info", "x", "--camera", "."}, "--camera .: is a folder, name a file");
}

TEST_F(CommandLine, PrintsTheRangeOfARefusedNumber) {
  expect_refused({"synth", "room", "-o", "x", "--width", "7"}, "--width 7: whole number expected, 64 to 4096");
  expect_refused({"synth", "room", "-o", "x", "--width", "wide"}, "--width wide: whole number expected");
  expect_refused({"bench", "x", "--voxel-size", "big"}, "--voxel-size big: number expected, 0.002 to 0.2 m");
  expect_refused({"export", out.path().string(), "-o", "x.ply", "--points", "0"},
                 "--points 0: number expected, more than 0");
  expect_refused({"export", out.path().string(), "-o", "x.ply", "--points", "-0.01"},
                 "--points -0.01: number expected, more than 0");
  for (const char* count : {"0", "-5", "many"})
    expect_refused({"export", out.path().string(), "-o", "x.glb", "--triangles", count},
                   std::string("--triangles ") + count + ": whole number expected, 100 to 4000000000");
  expect_refused({"export", out.path().string(), "-o", "x.glb", "--triangles", "500", "--simplify", "0.5"},
                 "exclude each other: leave one out");
  expect_refused({"synth", "room"}, "--output FOLDER is missing: cairn synth [options] SCENE -o FOLDER");
  expect_refused({"synth", "-o", "x"}, "SCENE is missing");
  expect_refused({"info", "x", "y"}, "unexpected argument y: cairn info [options] SEQUENCE");
  expect_refused({"info", "x", "--camera"}, "--camera takes FILE");
}

TEST_F(CommandLine, ExplainsFrameRangesByExamples) {
  for (const char* frames : {"5:2", "a", "1:2:0", "1:2:3:4", "-3", "0", "5:5", "1.5"}) {
    const std::string arguments = std::string("'") + frames + "' ";
    expect_refused({"convert", "synthetic:room", "-o", "x", "--frames", frames}, arguments);
    expect_refused({"convert", "synthetic:room", "-o", "x", "--frames", frames}, "for example 100, 0:300, 300:, ::3");
  }
}

TEST_F(CommandLine, ReadsTheFirstFramesByNumber) {
  const auto frames = [&](const std::string& range) {
    const Ran ran =
        run_cairn({"convert", "synthetic:plane", "-o", (out / range).string(), "--frames", range, "--json"});
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return ran.exit_code == 0 ? nlohmann::json::parse(ran.out).at("frames").get<int>() : -1;
  };
  EXPECT_EQ(frames("3"), 3);
  EXPECT_EQ(frames("1:3"), 2);
  EXPECT_EQ(frames(":2"), 2);
  EXPECT_EQ(frames("0:9:4"), 3);
}

TEST_F(CommandLine, HelpCommandEqualsHelpOption) {
  for (const auto& command : kCommands) {
    std::vector<std::string> by_option = command, by_command{"help"};
    by_option.emplace_back("--help");
    by_command.insert(by_command.end(), command.begin(), command.end());
    const Ran a = run_cairn(by_option), b = run_cairn(by_command);
    EXPECT_EQ(a.exit_code, 0);
    EXPECT_EQ(b.exit_code, 0);
    EXPECT_EQ(a.out, b.out);
    EXPECT_NE(a.out.find("usage: cairn " + command[0]), std::string::npos) << a.out;
    EXPECT_NE(a.out.find("--quiet"), std::string::npos) << a.out;
  }
  EXPECT_EQ(run_cairn({"--help"}).out, run_cairn({"help"}).out);
}

TEST_F(CommandLine, VersionListsLibrariesOnlyIfVerbose) {
  const std::string line = run_cairn({"--version"}).out, more = run_cairn({"--version", "--verbose"}).out;
  EXPECT_TRUE(std::regex_match(line, std::regex("cairn [0-9]+\\.[0-9]+\\.[0-9]+ \\([^ ()]+\\)\n"))) << line;
  EXPECT_EQ(run_cairn({"-V"}).out, line);
  EXPECT_EQ(run_cairn({"--verbose", "-V"}).out, more);  // in any order
  EXPECT_EQ(more.substr(0, line.size()), line);
  for (const char* expected : {"built ", "Ceres 2.", "meshoptimizer", "sessions ", "Mesa 2"})
    EXPECT_NE(more.find(expected), std::string::npos) << expected << more;
  const Ran alone = run_cairn({"--verbose", "devices"});
  EXPECT_EQ(alone.exit_code, 2);
  EXPECT_NE(alone.err.find("--version"), std::string::npos) << alone.err;
}

TEST_F(CommandLine, HelpFitsTheTerminalWithoutInternalNames) {
  for (const int columns : {40, 80, 120})
    for (auto command : kCommands) {
      command.emplace_back("--help");
      const Ran ran = run_cairn(command, "COLUMNS=" + std::to_string(columns));
      for (const char* internal :
           {"{", "}", "->", " in [", "FLOAT", "UINT", "INT:", "ENUM", "REQUIRED", "OPTIONS", "00000001", "99999"})
        EXPECT_EQ(ran.out.find(internal), std::string::npos) << internal << "\n" << ran.out;
      std::istringstream lines(ran.out);
      for (std::string line; std::getline(lines, line);)
        if (line.find("  cairn completion") == line.npos) {  // a command stays on one line
          EXPECT_LE(line.size(), static_cast<std::size_t>(columns)) << line;
        }
    }
}

TEST_F(CommandLine, QuietPrintsOnlyErrors) {
  const std::string room = (out / "room").string(), map = (out / "map").string();
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"synth", "room", "-o", room, "--frames", "20", "--width", "320", "--quiet"},
        {"--quiet", "convert", room, "-o", (out / "again").string()},
        {"reconstruct", room, "-o", map, "--voxel-size", "0.04", "-q"},
        {"export", map, "-o", (out / "x.glb").string(), "--quiet"}}) {
    const Ran ran = run_cairn(arguments);
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_EQ(ran.err, "");
    EXPECT_EQ(ran.out, "");
  }
  EXPECT_NE(run_cairn({"info", "-q", room}).out, "");  // the requested output is not progress
  expect_one_line(run_cairn({"-q", "info", (out / "nowhere").string()}), 1, "no such folder");
}

TEST_F(CommandLine, FileSystemErrorIsOneLineWithItsPath) {
  const std::string too_long(300, 'x');
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"reconstruct", too_long, "-o", (out / "map").string()}, {"info", too_long}}) {
    const Ran ran = run_cairn(arguments);
    expect_one_line(ran, 1, "File name too long");
    EXPECT_TRUE(ran.err.starts_with("cairn: " + too_long)) << ran.err;
  }
}

TEST_F(CommandLine, JsonNumbersHaveTheDecimalsOfTheOptions) {
  const std::string room = (out / "room").string(), map = (out / "map").string();
  ASSERT_EQ(run_cairn({"synth", "room", "-o", room, "--frames", "20", "--width", "320"}).exit_code, 0);
  const Ran ran = run_cairn({"reconstruct", room, "-o", map, "--voxel-size", "0.03", "--json"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  for (const std::string& text : {ran.out, read_bytes(out / "map" / "report.json")}) {
    EXPECT_NE(text.find("\"voxel_size\": 0.03\n"), std::string::npos) << text;
    EXPECT_NE(text.find("\"truncation\": 0.12,"), std::string::npos) << text;
  }
}

TEST_F(CommandLine, ReportsAFullDiskBehindStdout) {
  const auto to_full = [&](const std::string& arguments) {
    const std::string errors = (out / "err").string();
    const int status =
        std::system(("'" + program_file().string() + "' " + arguments + " >/dev/full 2>'" + errors + "'").c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1) << arguments;
    const std::string err = read_bytes(errors);
    EXPECT_NE(err.find("cannot write to stdout: No space left on device; free space at its destination"),
              std::string::npos)
        << arguments << ": " << err;
  };
  const std::string room = (out / "room").string();
  ASSERT_EQ(run_cairn({"synth", "room", "-o", room, "--frames", "20", "--width", "320"}).exit_code, 0);
  for (const auto& command : kCommands) to_full(command[0] + (command.size() > 1 ? " " + command[1] : "") + " --help");
  for (const char* arguments :
       {"", "help", "help --man", "--version", "--version --verbose", "devices", "doctor", "completion bash"})
    to_full(arguments);
  to_full("info '" + room + "'");
  to_full("info --json '" + room + "'");
  to_full("reconstruct '" + room + "' -o '" + (out / "map").string() + "' --voxel-size 0.04");
  EXPECT_TRUE(fs::exists(out / "map" / "mesh.glb"));  // only the messages are lost
  to_full("export '" + (out / "map").string() + "' -o '" + (out / "x.ply").string() + "'");
  to_full("esdf '" + (out / "map").string() + "'");
  to_full("convert '" + room + "' -o '" + (out / "again").string() + "'");
  to_full("synth plane -o '" + (out / "other").string() + "' --frames 2 --width 160");
  to_full("evaluate trajectory '" + (out / "map/trajectory.txt").string() + "' '" + room + "'");
  to_full("evaluate topology '" + (out / "map/mesh.glb").string() + "'");
}

TEST_F(CommandLine, DoctorChecksTheMachine) {
  const Ran ran = run_cairn({"doctor", "--json"});
  ASSERT_EQ(ran.exit_code, 0) << ran.out << ran.err;
  const auto result = nlohmann::json::parse(ran.out);
  EXPECT_TRUE(result.at("usable"));
  std::set<std::string> seen;
  bool works = false;
  for (const auto& check : result.at("checks")) {
    seen.insert(check.at("what").get<std::string>());
    works = works || check.at("words").get<std::string>().find("works: a frame in") != std::string::npos;
    EXPECT_TRUE(check.at("level") == "good" || check.contains("remedy")) << check;
  }
  EXPECT_TRUE(works);
  for (const char* what : {"device", "memory", "disk", "cores", "sensors", "pages", "build"})
    EXPECT_TRUE(seen.contains(what)) << what;
  const Ran none = run_cairn({"doctor"}, "VK_ICD_FILENAMES=/nowhere VK_DRIVER_FILES=/nowhere");
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_NE(none.out.find("unset it"), std::string::npos) << none.out;
}

TEST_F(CommandLine, DemoNeedsNoInput) {
  const Ran ran = run_cairn({"demo", "-o", (out / "demo").string()});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_TRUE(fs::exists(out / "demo" / "mesh.glb"));
  const auto report = nlohmann::json::parse(read_bytes(out / "demo" / "report.json"));
  EXPECT_EQ(report.at("frames").at("fused"), 60);
  EXPECT_NE(ran.out.find("cairn view"), std::string::npos) << ran.out;
  EXPECT_EQ(run_cairn({"demo", "-q", "-o", (out / "demo").string()}).exit_code, 0);  // may replace its own output
}

/// Completions expected in every shell, in a folder with file.yaml.
const std::vector<std::pair<std::string, std::string>> kCompletions{{"cairn recon", "reconstruct"},
                                                                    {"cairn evaluate tra", "trajectory"},
                                                                    {"cairn help evaluate tra", "trajectory"},
                                                                    {"cairn reconstruct --voxel-s", "--voxel-size"},
                                                                    {"cairn reconstruct x --motion ro", "robot"},
                                                                    {"cairn export x -o y --compress me", "meshopt"},
                                                                    {"cairn export x -o y --triang", "--triangles"},
                                                                    {"cairn synth co", "corridor"},
                                                                    {"cairn completion z", "zsh"},
                                                                    {"cairn info --camera fi", "file.yaml"},
                                                                    {"cairn info --frames 3 fi", "file.yaml"}};

TEST_F(CommandLine, BashCompletesCommandsOptionsValuesAndFiles) {
  write_text(out / "complete.bash", completion_of("bash"));
  write_text(out / "file.yaml", "");
  fs::create_directories(out / "folder");
  const auto complete = [&](const std::string& arguments) {
    return shell("cd '" + out.path().string() + "' && bash -c 'source ./complete.bash; COMP_WORDS=(" + arguments +
                 "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _cairn; echo \"${COMPREPLY[@]}\"'");
  };
  for (const auto& [arguments, completed] : kCompletions) EXPECT_EQ(complete(arguments), completed + "\n") << arguments;
  EXPECT_EQ(complete("cairn reconstruct x --motion = ro"), "robot\n");  // bash splits words at =
  EXPECT_EQ(complete("cairn info fo"), "folder\n");
  EXPECT_EQ(complete("cairn info --frames \"\""), "\n");  // a number
}

TEST_F(CommandLine, FishCompletesTheSame) {
  if (!is_installed("fish")) GTEST_SKIP() << "fish is not installed: scripts/install-deps --tests";
  write_text(out / "cairn.fish", completion_of("fish"));
  write_text(out / "file.yaml", "");
  const auto complete = [&](const std::string& arguments) {
    return shell("cd '" + out.path().string() + "' && HOME='" + out.path().string() +
                 "' fish -c 'source ./cairn.fish; complete -C \"" + arguments +
                 "\"' | cut -f1 | head -n 1");  // fish 4 also lists words with a match in the middle, after the rest
  };
  for (const auto& [arguments, completed] : kCompletions) EXPECT_EQ(complete(arguments), completed + "\n") << arguments;
}

TEST_F(CommandLine, ZshCompletesTheSame) {
  if (!is_installed("zsh")) GTEST_SKIP() << "zsh is not installed: scripts/install-deps --tests";
  fs::create_directories(out / "functions");
  write_text(out / "functions" / "_cairn", completion_of("zsh"));
  // Each read waits for its pattern; the key ^G, after Tab, prints the line as completed.
  write_text(out / "complete.zsh", R"(zmodload zsh/zpty
zpty shell zsh -f -i
zpty -w shell "PS1= ; fpath=($PWD/functions \$fpath); autoload -Uz compinit; compinit -u -D; cd $PWD; bindkey '^I' complete-word; unsetopt list_beep; finished() { print -rn -- \"<buffer:\$BUFFER>\" }; zle -N finished; bindkey '^G' finished; print -r -- set''up"
zpty -r shell text '*setup*'
zpty -w -n shell "$1"$'\t\a'
zpty -r shell text '*<buffer:*>*'
print -r -- ${${text##*<buffer:}%%>*}
zpty -d shell
)");
  const auto complete = [&](const std::string& arguments) {
    return shell("cd '" + out.path().string() + "' && timeout 60 zsh -f complete.zsh '" + arguments + "'");
  };
  EXPECT_EQ(complete("cairn recon"), "cairn reconstruct \n");
  EXPECT_EQ(complete("cairn evaluate tra"), "cairn evaluate trajectory \n");
  EXPECT_EQ(complete("cairn reconstruct x --motion rob"), "cairn reconstruct x --motion robot \n");
  EXPECT_EQ(complete("cairn synth corr"), "cairn synth corridor \n");
  EXPECT_EQ(complete("cairn info --camera complete.z"), "cairn info --camera complete.zsh \n");
}

TEST_F(CommandLine, ManualPagePassesLint) {
  if (!is_installed("mandoc")) GTEST_SKIP() << "mandoc is not installed: scripts/install-deps --tests";
  const Ran ran = run_cairn({"help", "--man"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  write_text(out / "cairn.1", ran.out);
  const std::string file = "'" + (out / "cairn.1").string() + "'";
  EXPECT_EQ(shell("mandoc -T lint -W warning " + file), "");
  const std::string page = shell("mandoc -T utf8 " + file + " | col -b");
  for (const auto& command : kCommands) EXPECT_NE(page.find("cairn " + command[0]), std::string::npos) << command[0];
  EXPECT_NE(page.find("--voxel-size LENGTH"), std::string::npos);
}

}  // namespace
}  // namespace cairn
