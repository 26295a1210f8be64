// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <malloc.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>

#include "commands.hpp"
#include "flags.hpp"
#include "json_text.hpp"

namespace {

/// What is buffered goes out; a full disk behind stdout is an error like others.
int ended(int exit_code) {
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good()) return exit_code;
  std::fprintf(stderr, "cairn: cannot write to stdout: %s; make room where it goes\n", std::strerror(errno));
  return 1;
}

int run(int argc, char** argv) {
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
  cairn::apps::add_convert(program);
  cairn::apps::add_info(program);
  cairn::apps::add_calibrate(program);
  cairn::apps::add_synth(program);
  cairn::apps::add_esdf(program);
  cairn::apps::add_evaluate(program);
  cairn::apps::add_merge(program);
  cairn::apps::add_graph(program);
  cairn::apps::add_bench(program);
  cairn::apps::add_devices(program);
  try {
    program.parse(argc, argv);
  } catch (const CLI::RuntimeError& error) {  // the work ended with an exit code of its own
    return ended(error.get_exit_code());
  } catch (const CLI::ParseError& error) {
    return ended(program.exit(error) == 0 ? 0 : 2);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cairn: %s\n", cairn::apps::in_flags(cairn::apps::plain(error.what())).c_str());
    return 1;
  }
  return ended(0);
}

}  // namespace

int main(int argc, char** argv) {
  constexpr int kLarge = 4 << 20;  // bytes: more than an image; from here on what is freed goes back to the system
  mallopt(M_MMAP_THRESHOLD, kLarge);
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {  // while it began, or told of another
    std::fprintf(stderr, "cairn: %s\n", error.what());
    return 1;
  }
}
