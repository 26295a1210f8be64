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

namespace cairn::apps {
namespace {

using namespace std::chrono_literals;

struct Arguments {
  std::filesystem::path map;
  int port = kDefaultViewerPort;
};

void view(const Arguments& a) {
  const Interrupt interrupt("");
  const MapViewer viewer(a.map, a.port);
  fmt::print("{}\n", viewer.url());
  std::fflush(stdout);
  fmt::print(stderr, "open this address in a browser on this machine; Ctrl-C ends\n");
  while (!interrupt.requested()) std::this_thread::sleep_for(100ms);
}

}  // namespace

void add_view(CLI::App& program) {
  auto* command = program.add_subcommand("view", "Show a finished map in a browser");
  const auto a = std::make_shared<Arguments>();
  command->add_option("MAP", a->map, "Folder that reconstruct, live or merge has made")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("--port", a->port, "On this machine; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->callback([a] { view(*a); });
}

}  // namespace cairn::apps
