// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Numeric options of all commands, as listed by the program: finds options with a different number syntax.
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <set>
#include <sstream>

#include "support/files.hpp"

namespace cairn {
namespace {

using Words = std::vector<std::string>;

struct NumericOption {
  Words command;
  std::string name, placeholder, help;
};

/// Placeholders of text, files and enumerations. A new placeholder must be a number or be added here.
const std::set<std::string> kNoNumbers{"",         "FILE",  "FOLDER", "PATH",  "TEXT",      "WORD",
                                       "TEXT ...", "RANGE", "X,Y,Z",  "PLACE", "PLANE PNG", "SCALE"};

std::string help_of(Words command) {
  command.emplace_back("--help");
  return run_cairn(command, "COLUMNS=1000").out;
}

/// Subcommands in the help of a command.
std::vector<Words> commands_below(const Words& command) {
  std::vector<Words> all;
  const std::string help = help_of(command);
  const bool has_commands = help.find(" COMMAND [options]") != help.npos;
  std::istringstream lines(help);
  for (std::string line; has_commands && std::getline(lines, line);)
    if (std::smatch name; std::regex_search(line, name, std::regex("^  ([a-z]+)  +[^ ]"))) {
      Words below = command;
      below.push_back(name[1]);
      all.push_back(below);
    }
  return all;
}

std::vector<NumericOption> numeric_options() {
  std::vector<NumericOption> all;
  std::vector<Words> commands = commands_below({});
  for (std::size_t i = 0; i < commands.size(); ++i) {
    const auto below = commands_below(commands[i]);
    commands.insert(commands.end(), below.begin(), below.end());
    const std::string help = help_of(commands[i]);
    // "  -o, --output FILE   description": names, a placeholder of words in capitals, and text of one line or more.
    const std::regex entry("^  (?:-[^ ,]+, )*(--[a-z-]+)((?: [A-Z.,:]+)*)(?:  +(.*))?$");
    std::istringstream lines(help);
    bool is_numeric = false;
    for (std::string line; std::getline(lines, line);) {
      std::smatch found;
      if (std::regex_match(line, found, entry)) {
        const std::string placeholder = found[2].length() > 0 ? found[2].str().substr(1) : "";
        is_numeric = !kNoNumbers.contains(placeholder);
        if (is_numeric) all.push_back({commands[i], found[1], placeholder, found[3]});
      } else if (is_numeric && line.starts_with("      ")) {
        all.back().help += " " + line.substr(line.find_first_not_of(' '));
      } else {
        is_numeric = false;
      }
    }
  }
  return all;
}

/// Upper bound of the range in the help, with its unit.
std::optional<std::string> most_of(const std::string& help) {
  std::smatch found;
  const std::regex range("; (?:-?[0-9.e-]+ to|more than [0-9.]+, at most) ([0-9.e+]+)( m2| m| s| Hz| px| MiB)?");
  if (!std::regex_search(help, found, range)) return std::nullopt;
  return found[1].str();
}

class Numbers : public testing::Test {
 protected:
  static void SetUpTestSuite() { options = numeric_options(); }
  static Ran run(const NumericOption& o, const std::string& value) {
    Words words = o.command;
    const auto count = std::count(o.placeholder.begin(), o.placeholder.end(), ' ') + 1;
    if (o.placeholder.find("...") == std::string::npos && count == 1)
      words.push_back(o.name + "=" + value);
    else
      words.insert(words.end(), {o.name, value, "0", "0", "0", "0", "0"});
    // CLI11 reserves the last words after a list for required files.
    if (o.placeholder.find("...") != std::string::npos) words.insert(words.end(), {"/dev/null", "/dev/null"});
    return run_cairn(words);
  }
  static bool is_refused(const Ran& ran, const NumericOption& o, const std::string& value) {
    return ran.exit_code == 2 && ran.out.empty() && std::count(ran.err.begin(), ran.err.end(), '\n') == 1 &&
           ran.err.find(": " + o.name + " " + value + ": ") != ran.err.npos &&
           ran.err.find("number expected") != ran.err.npos;
  }
  static std::vector<NumericOption> options;
};
std::vector<NumericOption> Numbers::options;

TEST_F(Numbers, AreFiniteAndOfTheRightUnitInEveryOption) {
  EXPECT_GT(options.size(), 60u);
  for (const NumericOption& o : options)
    for (const std::string value : {"nan", "inf", "-inf", "1e999", "many", "5kg", "0x10"}) {
      const Ran ran = run(o, value);
      EXPECT_TRUE(is_refused(ran, o, value)) << o.command.back() << " " << o.name << " " << value << ": " << ran.err;
    }
}

TEST_F(Numbers, HaveTheRangeOfTheirHelp) {
  for (const NumericOption& o : options) {
    const auto most = most_of(o.help);
    ASSERT_TRUE(most) << o.command.back() << " " << o.name << ": no range in: " << o.help;
    const Ran at = run(o, *most);
    EXPECT_EQ(at.err.find("number expected"), std::string::npos) << o.command.back() << " " << o.name << at.err;
    const bool is_whole = most->find('.') == std::string::npos;
    const std::string beyond = is_whole ? std::to_string(std::stoll(*most) + 1) : *most + "0001";
    EXPECT_TRUE(is_refused(run(o, beyond), o, beyond)) << o.command.back() << " " << o.name << " " << beyond;
  }
}

TEST_F(Numbers, ThatAreLengthsAndTimesTakeUnits) {
  int lengths = 0, times = 0;
  for (const NumericOption& o : options) {
    const bool is_length = o.placeholder.starts_with("LENGTH"), is_time = o.placeholder == "TIME";
    lengths += is_length, times += is_time;
    if (!is_length && !is_time) continue;
    for (const std::string& value : is_length ? Words{"1.05m", "105cm", "1050mm"} : Words{"1s", "1000ms"}) {
      const Ran with = run(o, value), without = run(o, is_length ? "1.05" : "1");
      // In range or not, a unit makes no difference; any other message is about missing arguments.
      const auto is_number = [](const Ran& ran) { return ran.err.find("number expected") == ran.err.npos; };
      EXPECT_EQ(is_number(with), is_number(without)) << o.name << " " << value << with.err << without.err;
    }
  }
  EXPECT_GT(lengths, 15);
  EXPECT_GT(times, 4);
}

TEST_F(Numbers, InAConfigurationAreAsTheyAreOnTheCommandLine) {
  const TemporaryFolder folder;
  for (const auto& [text, key] : {std::pair{"fuse: {voxel_size: .nan}", "fuse.voxel_size"},
                                  {"fuse: {voxel_size: nan}", "fuse.voxel_size"},
                                  {"esdf: {max_distance: .inf}", "esdf.max_distance"},
                                  {"map: {submap_radius: 1e999}", "map.submap_radius"},
                                  {"track: {levels: 2.5}", "track.levels"},
                                  {"fuse: {voxel_size: 0.2000001}", "fuse.voxel_size"}}) {
    write_text(folder / "o.yaml", text);
    const Ran ran = run_cairn(
        {"reconstruct", "synthetic:room", "-o", (folder / "map").string(), "--config", (folder / "o.yaml").string()});
    expect_one_line(ran, 1, std::string("o.yaml:1: `") + key + "` has an invalid value; expected ");
  }
}

TEST_F(Numbers, InListsAreFiniteToo) {
  const TemporaryFolder folder;
  write_text(folder / "map.vdb", "");
  const std::string map = (folder / "map.vdb").string();
  for (const Words& words : std::vector<Words>{{"esdf", map, "--slice", "z=nan", "x.png"},
                                               {"esdf", map, "--slice", "z=inf", "x.png"},
                                               {"esdf", map, "--costmap", "x.yaml", "--height", "nan:1"},
                                               {"esdf", map, "--costmap", "x.yaml", "--height", "0:inf"},
                                               {"export", map, "-o", "tileset.json", "--geo", "nan,0,0,0"},
                                               {"export", map, "-o", "tileset.json", "--geo", "1,2,3"},
                                               {"export", map, "-o", "x.pdf", "--scale", "nan"},
                                               {"export", map, "-o", "x.pdf", "--scale", "1:99999999999"},
                                               {"esdf", map, "--cell", "0,nan,0"},
                                               {"esdf", map, "--cell", "0,0,99999999999"}}) {
    const Ran ran = run_cairn(words);
    EXPECT_EQ(ran.exit_code, 2) << ran.err;
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << ran.err;
  }
}

}  // namespace
}  // namespace cairn
