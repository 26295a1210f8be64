// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <system_error>
#include <thread>

#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/flags.hpp"
#include "cli/help.hpp"
#include "cli/interrupt.hpp"
#include "cli/json_text.hpp"
#include "cli/old_names.hpp"
#include "cli/version.hpp"

namespace {

using cairn::apps::strip_json_prefix;
using cairn::apps::with_flag_names;

/// Reports a failed write to stdout, such as on a full disk. Returns exit code 1.
int report_write_error(int error) {
  std::fprintf(stderr, "cairn: cannot write to stdout: %s; free space at its destination\n", std::strerror(error));
  return 1;
}

/// Flushes stdout and returns the exit code.
int finish(int exit_code) {
  cairn::apps::block_if_exiting();
  std::cout.flush();
  const bool is_written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good();
  return is_written ? exit_code : report_write_error(errno);
}

int fail(const std::string& why, int exit_code) {
  cairn::apps::block_if_exiting();  // failures caused by the ending are not reported
  cairn::apps::clear_line();
  std::fprintf(stderr, "%s\n", why.c_str());
  return exit_code;
}

template <class Visit>
void for_all_commands(CLI::App& command, const Visit& visit) {
  visit(command);
  for (CLI::App* subcommand : command.get_subcommands({})) for_all_commands(*subcommand, visit);
}

void add_commands(CLI::App& program) {
  using namespace cairn::apps;
  const auto group = [&](const char* title, std::initializer_list<void (*)(CLI::App&)> commands) {
    const std::size_t before = program.get_subcommands({}).size();
    for (const auto add : commands) add(program);
    const auto all = program.get_subcommands({});
    for (std::size_t i = before; i < all.size(); ++i) all[i]->group(title);
  };
  group("Getting started", {add_demo, add_doctor});
  group("Make a map", {add_reconstruct, add_live, add_record});
  group("Use a map", {add_view, add_export, add_localize, add_splat, add_esdf, add_change, add_merge});
  group("Map a building", {add_plan, add_match, add_optimize, add_tile, add_tileset});
  group("Recordings", {add_info, add_convert, add_calibrate, add_synth});
  group("Measure", {add_evaluate, add_bench, add_graph, add_devices});
  group("Program", {add_help, add_completion});
  for_all_commands(program, [](CLI::App& command) {
    command.formatter(help_format());
    command.get_help_ptr()->description("Print this help");
    command.add_flag_callback("-q,--quiet", set_quiet, "Print only warnings, errors and requested output");
  });
}

int run(const std::vector<std::string>& given) {
  cairn::apps::set_up_warnings();
  const auto arguments = cairn::apps::with_current_names(given);
  CLI::App program("Dense RGB-D mapping: a depth-camera stream becomes a mesh, a TSDF and a trajectory.", "cairn");
  bool verbose = false;
  auto* more = program.add_flag("--verbose", verbose, "With --version: also devices, drivers and libraries");
  auto* version = program.set_version_flag(
      "-V,--version",
      [&verbose] {
        return verbose ? cairn::apps::version_in_full(cairn::apps::terminal_of(STDOUT_FILENO).columns)
                       : cairn::apps::version_line();
      },
      "Print the version");
  more->needs(version);
  program.require_subcommand(1);
  add_commands(program);
  if (arguments.empty()) {
    std::cout << cairn::apps::introduction(cairn::apps::terminal_of(STDOUT_FILENO).columns);
    return finish(0);
  }
  try {
    if (const auto unknown = cairn::apps::unknown_word(program, arguments)) return fail(*unknown, 2);
    program.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));  // CLI11 expects reverse order
  } catch (const CLI::RuntimeError& error) {  // regular end with its own exit code
    return finish(error.get_exit_code());
  } catch (const CLI::Success& success) {
    program.exit(success);
    return finish(0);
  } catch (const CLI::ParseError& error) {
    return fail(with_flag_names(cairn::apps::usage_error(program, arguments, error)), 2);
  } catch (const std::filesystem::filesystem_error& error) {
    const std::string place = error.path1().empty() ? "" : error.path1().string() + ": ";
    return fail("cairn: " + with_flag_names(strip_json_prefix(place + error.code().message())), 1);
  } catch (const std::exception& error) {
    const auto* system_error = dynamic_cast<const std::system_error*>(&error);  // thrown by fmt
    if (system_error != nullptr && std::ferror(stdout) != 0) return report_write_error(system_error->code().value());
    return fail("cairn: " + with_flag_names(strip_json_prefix(error.what())), 1);
  }
  return finish(0);
}

}  // namespace

int main(int argc, char** argv) {
  cairn::apps::install_signal_handlers();
  constexpr int kLarge = 4 << 20;  // bytes, more than an image; larger blocks return to the system when freed
  constexpr int kKept = 64 << 20;  // bytes of freed memory: images of a frame reuse those of the last one
  mallopt(M_MMAP_THRESHOLD, kLarge);
  mallopt(M_TRIM_THRESHOLD, kKept);
  // Shares freed memory between threads; by default, each of some dozen arenas keeps its own.
  mallopt(M_ARENA_MAX, std::max(2, static_cast<int>(std::thread::hardware_concurrency())));
  try {
    return run({argv + 1, argv + argc});
  } catch (const std::exception& error) {  // while starting, or while reporting another exception
    std::fprintf(stderr, "cairn: %s\n", error.what());
    return 1;
  }
}
