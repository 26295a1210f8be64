// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cairn/quoted.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "json_text.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

/// Two seconds of camera motion in the room.
constexpr const char *kScene = "synthetic:room", *kFrames = "60";

/// Returns true if a folder holds an earlier demo, which may be replaced.
bool is_demo(const fs::path& folder) {
  try {
    const nlohmann::json report = json_in(folder / "report.json");
    return report.is_object() && report.value("sequence", nlohmann::json()) == kScene;
  } catch (const std::exception&) {
    return false;
  }
}

void demo(const fs::path& output) {
  CLI::App program("", "cairn");
  add_reconstruct(program);
  std::vector<std::string> words{"reconstruct", kScene, "-o", output.string(), "--frames", kFrames};
  if (is_demo(output)) words.emplace_back("--overwrite");
  std::reverse(words.begin(), words.end());  // CLI11 expects reverse order
  program.parse(words);
  const fs::path page = output / "report.html";
  say("\nlook at it  {}\n", fs::absolute(fs::exists(page) ? page : output / "mesh.glb").string());
  say("or serve it cairn view {}\nnext        cairn reconstruct FOLDER -o OUT, with a recording of your own\n",
      quoted(output));
}

}  // namespace

void add_demo(CLI::App& program) {
  auto* command =
      program.add_subcommand("demo", "Map 60 frames of a synthetic room: no camera, no files, under a minute");
  const auto output = std::make_shared<fs::path>("cairn-demo");
  command->add_option("-o,--output", *output, "Folder for the map and its page")
      ->type_name(kFolder)
      ->capture_default_str();
  command->callback([output] { demo(*output); });
}

}  // namespace cairn::apps
