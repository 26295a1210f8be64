// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <cstdio>

#include "commands.hpp"

int main(int argc, char** argv) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("cairn"));
  spdlog::set_pattern("%^%l%$ %v");
  CLI::App program("Dense RGB-D mapping: a depth-camera stream becomes a mesh, a TSDF and a trajectory.", "cairn");
  program.set_version_flag("--version", CAIRN_VERSION);
  program.require_subcommand(1);
  cairn::apps::add_reconstruct(program);
  cairn::apps::add_export(program);
  cairn::apps::add_live(program);
  cairn::apps::add_record(program);
  cairn::apps::add_view(program);
  cairn::apps::add_synth(program);
  cairn::apps::add_esdf(program);
  cairn::apps::add_evaluate(program);
  cairn::apps::add_merge(program);
  cairn::apps::add_graph(program);
  cairn::apps::add_devices(program);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cairn: %s\n", error.what());
    return 1;
  }
  return 0;
}
