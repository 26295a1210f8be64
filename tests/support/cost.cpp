// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/cost.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <exception>

#include "support/files.hpp"

namespace cairn {
namespace {

/// `child` must not return.
Cost cost_of_child(const std::function<void(const std::filesystem::path&)>& child, int max_seconds) {
  const TemporaryFolder folder;
  const auto begin = std::chrono::steady_clock::now();
  const pid_t pid = fork();
  if (pid == 0) {
    alarm(static_cast<unsigned>(max_seconds));
    child(folder / "error");
    _exit(127);
  }
  int status = 0;
  rusage usage{};
  wait4(pid, &status, 0, &usage);
  return {.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(),
          .peak_mb = static_cast<double>(usage.ru_maxrss) / 1024,
          .ended = WIFEXITED(status) && WEXITSTATUS(status) <= 1,
          .error = read_bytes(folder / "error")};
}

}  // namespace

Cost cost_of(const std::function<void()>& call, int max_seconds) {
  return cost_of_child(
      [&](const std::filesystem::path& error) {
        try {
          call();
        } catch (const std::exception& thrown) {
          write_text(error, thrown.what());
          _exit(1);
        }
        _exit(0);
      },
      max_seconds);
}

Cost cost_of_cairn(const std::vector<std::string>& arguments, int max_seconds) {
  return cost_of_child(
      [&](const std::filesystem::path& error) {
        const std::string program = program_file().string();
        std::vector<char*> words{const_cast<char*>(program.c_str())};
        for (const auto& a : arguments) words.push_back(const_cast<char*>(a.c_str()));
        words.push_back(nullptr);
        dup2(open("/dev/null", O_WRONLY), STDOUT_FILENO);
        dup2(open(error.c_str(), O_WRONLY | O_CREAT, 0600), STDERR_FILENO);
        execv(words[0], words.data());
      },
      max_seconds);
}

}  // namespace cairn
