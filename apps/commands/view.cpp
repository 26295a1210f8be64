// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <thread>

#include "cairn/building/project.hpp"
#include "cairn/mapping/viewer.hpp"
#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "cli/plan_info.hpp"
#include "cli/run.hpp"
#include "cli/view_options.hpp"

namespace cairn::apps {
namespace {

using namespace std::chrono_literals;

struct Arguments : ViewArguments {
  std::filesystem::path map;
};

void view(const Arguments& a) {
  const MapViewer viewer(a.map, a.at);
  const Interrupt interrupt(Interrupt::Graceful::now, "");
  if (is_project_folder(a.map))
    if (const auto joined = merged_segments(a.map)) {
      const Verdict verdict = verdict_of(read_plan(a.map), *joined);
      if (verdict.level != Verdict::Level::good) print(verdict, stderr);
    }
  fmt::print("{}\n", viewer.site().urls.front().url);
  std::fflush(stdout);
  fmt::print(stderr, "open this address in a browser{}; Ctrl-C ends\n",
             viewer.site().fingerprint.empty() ? " on this machine" : "");
  const auto page =
      announce_page(a, viewer.site(), "see the map and take its files", [&viewer] { return viewer.is_opened(); });
  while (!interrupt.requested()) std::this_thread::sleep_for(100ms);
}

}  // namespace

void add_view(CLI::App& program) {
  auto* command = program.add_subcommand("view", "Show a finished map, or a mesh, in a browser");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option("MAP", a->map,
                   "Folder written by reconstruct, live or merge, a project with tiles, or a .glb, .gltf, .ply, "
                   ".spz, .vdb or tileset.json file")
      ->required()
      ->check(CLI::ExistingPath);
  add_view_options(*command, *a);
  command->callback([a] { view(*a); });
}

}  // namespace cairn::apps
