// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "browser.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <sstream>
#include <thread>
#include <vector>

namespace cairn::apps {
namespace {

/// $BROWSER is a list with colons between; `%s` stands for the address, which else comes last.
std::vector<std::vector<std::string>> commands(const std::string& url) {
  std::vector<std::vector<std::string>> all;
  const char* given = std::getenv("BROWSER");
  std::istringstream list(given != nullptr ? given : "");
  for (std::string entry; std::getline(list, entry, ':');) {
    std::vector<std::string> words;
    std::istringstream line(entry);
    bool has_place = false;
    for (std::string word; line >> word;) {
      const auto at = word.find("%s");
      if (at != word.npos) word.replace(at, 2, url);
      has_place = has_place || at != word.npos;
      words.push_back(word);
    }
    if (words.empty()) continue;
    if (!has_place) words.push_back(url);
    all.push_back(std::move(words));
  }
  all.push_back({"xdg-open", url});
  return all;
}

/// The process, without the terminal, or 0 where there is no such program.
pid_t start(const std::vector<std::string>& words) {
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    posix_spawn_file_actions_addopen(&actions, descriptor, "/dev/null", O_RDWR, 0);
  posix_spawnattr_t attributes;  // a group of its own: Ctrl-C is for Cairn
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t process = 0;
  const int error = posix_spawnp(&process, arguments[0], &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return error == 0 ? process : 0;
}

bool succeeds(pid_t process) {
  int status = 0;
  while (waitpid(process, &status, 0) < 0)
    if (errno != EINTR) return true;  // nobody knows
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

void open_browser(const std::string& url) {
  std::thread([all = commands(url)] {
    for (const auto& words : all)
      if (const pid_t process = start(words); process != 0 && succeeds(process)) return;
    fmt::print(stderr, "no browser could be opened: open the address yourself, or name one in BROWSER\n");
  }).detach();
}

}  // namespace cairn::apps
