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

#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "flags.hpp"
#include "help.hpp"
#include "interrupt.hpp"
#include "json_text.hpp"
#include "version.hpp"

namespace {

using cairn::apps::in_flags;
using cairn::apps::plain;

/// Reports a failed write to stdout, such as on a full disk. Returns exit code 1.
int not_written(int error) {
  std::fprintf(stderr, "cairn: cannot write to stdout: %s; make room where it goes\n", std::strerror(error));
  return 1;
}

/// Flushes stdout and returns the exit code.
int ended(int exit_code) {
  cairn::apps::wait_while_ending();
  std::cout.flush();
  const bool is_written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good();
  return is_written ? exit_code : not_written(errno);
}

int failed(const std::string& why, int exit_code) {
  cairn::apps::wait_while_ending();  // failures caused by the ending are not reported
  cairn::apps::clear_line();
  std::fprintf(stderr, "%s\n", why.c_str());
  return exit_code;
}

template <class Visit>
void for_all_commands(CLI::App& command, const Visit& visit) {
  visit(command);
  for (CLI::App* below : command.get_subcommands({})) for_all_commands(*below, visit);
}

void add_commands(CLI::App& program) {
  using namespace cairn::apps;
  const auto group = [&](const char* title, std::initializer_list<void (*)(CLI::App&)> commands) {
    const std::size_t before = program.get_subcommands({}).size();
    for (const auto add : commands) add(program);
    const auto all = program.get_subcommands({});
    for (std::size_t i = before; i < all.size(); ++i) all[i]->group(title);
  };
  group("To begin", {add_demo, add_doctor});
  group("Make a map", {add_reconstruct, add_live, add_record});
  group("Use a map", {add_view, add_export, add_esdf, add_change, add_merge});
  group("Map a building", {add_plan, add_match, add_optimise, add_tile, add_tileset});
  group("Recordings", {add_info, add_convert, add_calibrate, add_synth});
  group("Measure", {add_evaluate, add_bench, add_graph, add_devices});
  group("The program", {add_help, add_completion});
  for_all_commands(program, [](CLI::App& command) {
    command.formatter(help_format());
    command.get_help_ptr()->description("Print this help");
    command.add_flag_callback("-q,--quiet", be_quiet, "No progress: warnings, errors and what was asked for alone");
  });
}

int run(const std::vector<std::string>& words) {
  cairn::apps::set_up_warnings();
  CLI::App program("Dense RGB-D mapping: a depth-camera stream becomes a mesh, a TSDF and a trajectory.", "cairn");
  bool verbose = false;
  auto* more = program.add_flag("--verbose", verbose, "With --version: devices, drivers and libraries as well");
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
  if (words.empty()) {
    std::cout << cairn::apps::first_words(cairn::apps::terminal_of(STDOUT_FILENO).columns);
    return ended(0);
  }
  try {
    if (const auto unknown = cairn::apps::unknown_word(program, words)) return failed(*unknown, 2);
    program.parse(std::vector<std::string>(words.rbegin(), words.rend()));  // CLI11 expects reverse order
  } catch (const CLI::RuntimeError& error) {                                // regular end with its own exit code
    return ended(error.get_exit_code());
  } catch (const CLI::Success& asked) {
    program.exit(asked);
    return ended(0);
  } catch (const CLI::ParseError& error) {
    return failed(in_flags(cairn::apps::usage_error(program, words, error)), 2);
  } catch (const std::filesystem::filesystem_error& error) {
    const std::string place = error.path1().empty() ? "" : error.path1().string() + ": ";
    return failed("cairn: " + in_flags(plain(place + error.code().message())), 1);
  } catch (const std::exception& error) {
    const auto* told = dynamic_cast<const std::system_error*>(&error);  // thrown by fmt
    if (told != nullptr && std::ferror(stdout) != 0) return not_written(told->code().value());
    return failed("cairn: " + in_flags(plain(error.what())), 1);
  }
  return ended(0);
}

}  // namespace

int main(int argc, char** argv) {
  cairn::apps::answer_signals();
  constexpr int kLarge = 4 << 20;  // bytes, more than an image; larger blocks return to the system when freed
  mallopt(M_MMAP_THRESHOLD, kLarge);
  // Shares freed memory between threads; by default, each of some dozen arenas keeps its own.
  mallopt(M_ARENA_MAX, std::max(2, static_cast<int>(std::thread::hardware_concurrency())));
  try {
    return run(std::vector<std::string>(argv + 1, argv + argc));
  } catch (const std::exception& error) {  // while starting, or while reporting another exception
    std::fprintf(stderr, "cairn: %s\n", error.what());
    return 1;
  }
}
