// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "output_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string_view>

#include "cairn/atomic_file.hpp"
#include "cairn/writable_folder.hpp"
#include "command_tree.hpp"
#include "sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

// Files written by Outputs; a session is detected by its state file.
constexpr std::array<std::string_view, 10> kWritten{"mesh.glb",       "map.vdb",           "report.json", "report.html",
                                                    "trajectory.txt", "graph.g2o",         "preview.glb", "graph.svg",
                                                    kMapCamera,       "session/state.cbor"};

bool is_free(const fs::path& folder) {
  return !fs::exists(folder) || (fs::is_directory(folder) && fs::is_empty(folder));
}

/// The first unused folder of OUT-2, OUT-3, ...
fs::path free_name(const fs::path& output) {
  fs::path plain = output.has_filename() ? output : output.parent_path();
  if (plain.filename() == "." || plain.filename() == "..") plain = tidy(plain);
  for (int number = 2;; ++number)
    if (fs::path next = plain.parent_path() / fmt::format("{}-{}", plain.filename().string(), number); is_free(next))
      return next;
}

}  // namespace

void add_output_options(CLI::App& command, OutputArguments& a, const std::string& names, const std::string& help) {
  command.add_option(names, a.output, help)->required()->type_name(kFolder);
  auto* overwrite =
      command.add_flag("--overwrite", a.overwrite, "Replace the map in OUT; it stays until the new one is written");
  command.add_flag("--auto-name", a.auto_name, "Where OUT holds a map, take OUT-2, OUT-3, ... and tell which")
      ->excludes(overwrite);
}

fs::path choose_output(const OutputArguments& a, bool can_resume) {
  if (a.overwrite) return a.output;
  const auto* found = std::find_if(kWritten.begin(), kWritten.end(),
                                   [&](const std::string_view name) { return fs::exists(a.output / name); });
  if (found == kWritten.end()) return a.output;
  if (a.auto_name) {
    fs::path chosen = free_name(a.output);
    fmt::print(stderr, "output      {} ({} holds a map)\n", chosen.string(), a.output.string());
    return chosen;
  }
  const bool was_cut_off = fs::exists(a.output / "session" / "state.cbor") && !fs::exists(a.output / "report.json");
  if (was_cut_off && can_resume)
    throw std::runtime_error(
        fmt::format("{}: holds a run that was cut off: go on with --resume, or give --overwrite to begin again, or "
                    "--auto-name to take another name",
                    a.output.string()));
  throw std::runtime_error(
      fmt::format("{}: holds a map already ({}): give --overwrite to replace it,{} or --auto-name to take another name",
                  a.output.string(), *found, can_resume ? " --resume to go on with it," : ""));
}

std::string name_of_trajectory(int recording) { return fmt::format("trajectory-{:03}.txt", recording); }

std::string name_of_trajectory(int recording, int recordings) {
  return recording + 1 == recordings ? "trajectory.txt" : name_of_trajectory(recording);
}

void prepare_output(const fs::path& output) {
  std::error_code error;
  fs::create_directories(output, error);
  if (error || !fs::is_directory(output))
    throw std::runtime_error("cannot make the folder " + output.string() + ": " + error.message() +
                             "; choose another with -o");
  expect_writable(output);
  remove_leftovers(output);
}

}  // namespace cairn::apps
