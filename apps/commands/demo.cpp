// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/quoted.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/json_text.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

/// Two seconds of camera motion in the room.
constexpr const char *kScene = "synthetic:room", *kFrames = "60";

/// Returns true if a folder holds an earlier demo, which may be replaced.
bool is_demo(const fs::path& folder) {
  try {
    const nlohmann::json report = read_json(folder / "report.json");
    return report.is_object() && report.value("sequence", nlohmann::json()) == kScene;
  } catch (const std::exception&) {
    return false;
  }
}

void demo(const fs::path& output) {
  CLI::App program("", "cairn");
  add_reconstruct(program);
  std::vector<std::string> arguments{"reconstruct", kScene, "-o", output.string(), "--frames", kFrames};
  if (is_demo(output)) arguments.emplace_back("--overwrite");
  std::reverse(arguments.begin(), arguments.end());  // CLI11 expects reverse order
  program.parse(arguments);
  const fs::path page = output / "report.html";
  print_result("\nopen        {}\n", fs::absolute(fs::exists(page) ? page : output / "mesh.glb").string());
  print_result("or run      cairn view {}\nnext        cairn reconstruct FOLDER -o OUT, with your own recording\n",
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
