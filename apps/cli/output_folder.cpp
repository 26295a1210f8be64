// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/output_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string_view>

#include "base/atomic_file.hpp"
#include "base/writable_folder.hpp"
#include "cli/command_tree.hpp"
#include "cli/sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

// Files written by Outputs; a session is detected by its state file.
constexpr std::array<std::string_view, 10> kMapFiles{
    "mesh.glb",  "map.vdb",     "report.json", "report.html", "trajectory.txt",
    "graph.g2o", "preview.glb", "graph.svg",   kMapCamera,    "session/state.cbor"};

bool is_unused(const fs::path& folder) {
  return !fs::exists(folder) || (fs::is_directory(folder) && fs::is_empty(folder));
}

/// The first unused folder of OUT-2, OUT-3, ...
fs::path unused_name(const fs::path& output) {
  fs::path base = output.has_filename() ? output : output.parent_path();
  if (base.filename() == "." || base.filename() == "..") base = tidy(base);
  for (int number = 2;; ++number)
    if (fs::path next = base.parent_path() / fmt::format("{}-{}", base.filename().string(), number); is_unused(next))
      return next;
}

}  // namespace

void add_output_options(CLI::App& command, OutputArguments& a, const std::string& names, const std::string& help) {
  command.add_option(names, a.output, help)->required()->type_name(kFolder);
  auto* overwrite =
      command.add_flag("--overwrite", a.overwrite, "Replace the map in OUT; it stays until the new one is written");
  command.add_flag("--auto-name", a.auto_name, "If OUT contains a map, use OUT-2, OUT-3, ... and print which")
      ->excludes(overwrite);
}

fs::path choose_output(const OutputArguments& a, bool can_resume) {
  if (a.overwrite) return a.output;
  const auto* existing = std::find_if(kMapFiles.begin(), kMapFiles.end(),
                                      [&](const std::string_view name) { return fs::exists(a.output / name); });
  if (existing == kMapFiles.end()) return a.output;
  if (a.auto_name) {
    fs::path unused = unused_name(a.output);
    fmt::print(stderr, "output      {} ({} contains a map)\n", unused.string(), a.output.string());
    return unused;
  }
  const bool was_cut_off = fs::exists(a.output / "session" / "state.cbor") && !fs::exists(a.output / "report.json");
  if (was_cut_off && can_resume)
    throw std::runtime_error(
        fmt::format("{}: contains an interrupted run: use --resume to continue it, --overwrite to start again, or "
                    "--auto-name to use another name",
                    a.output.string()));
  throw std::runtime_error(fmt::format(
      "{}: already contains a map ({}): use --overwrite to replace it,{} or --auto-name to use another name",
      a.output.string(), *existing, can_resume ? " --resume to continue it," : ""));
}

std::string name_of_trajectory(int recording) { return fmt::format("trajectory-{:03}.txt", recording); }

std::string name_of_trajectory(int recording, int recordings) {
  return recording + 1 == recordings ? "trajectory.txt" : name_of_trajectory(recording);
}

void prepare_output(const fs::path& output) {
  std::error_code error;
  fs::create_directories(output, error);
  if (error || !fs::is_directory(output))
    throw std::runtime_error("cannot create the folder " + output.string() + ": " + error.message() +
                             "; choose another with -o");
  expect_writable(output);
  remove_leftovers(output);
}

}  // namespace cairn::apps
