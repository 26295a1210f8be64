// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <thread>

#include "cairn/viewer.hpp"
#include "commands.hpp"
#include "interrupt.hpp"
#include "view_options.hpp"

namespace cairn::apps {
namespace {

using namespace std::chrono_literals;

struct Arguments : ViewArguments {
  std::filesystem::path map;
};

void view(const Arguments& a) {
  const MapViewer viewer(a.map, a.at);
  const Interrupt interrupt(Interrupt::Worth::now, "");
  fmt::print("{}\n", viewer.site().urls.front().url);
  std::fflush(stdout);
  fmt::print(stderr, "open this address in a browser{}; Ctrl-C ends\n",
             viewer.site().fingerprint.empty() ? " on this machine" : "");
  tell_how_to_open(a, viewer.site(), "see the map and take its files");
  while (!interrupt.requested()) std::this_thread::sleep_for(100ms);
}

}  // namespace

void add_view(CLI::App& program) {
  auto* command = program.add_subcommand("view", "Show a finished map, or a mesh, in a browser");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option(
          "MAP", a->map,
          "Folder that reconstruct, live or merge has made, a plan's that has been tiled, or a .glb, .gltf, .ply, "
          ".vdb or tileset.json file")
      ->required()
      ->check(CLI::ExistingPath);
  add_view_options(*command, *a);
  command->callback([a] { view(*a); });
}

}  // namespace cairn::apps
