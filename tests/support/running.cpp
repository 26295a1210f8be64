// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/running.hpp"

#include <fcntl.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>
#include <utility>

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
constexpr auto kPatience = 2min;

/// Child process: sets its streams and its folder, and executes the program.
[[noreturn]] void become(std::vector<std::string> words, const fs::path& folder, const fs::path& out,
                         const fs::path& err, int terminal, const std::string& library) {
  constexpr int kNotStarted = 127;
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const int to_out = open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600),
            to_err = terminal >= 0 ? terminal : open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  setpgid(0, 0);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, SIG_DFL);
  if (chdir(folder.c_str()) == 0 && dup2(to_out, STDOUT_FILENO) >= 0 && dup2(to_err, STDERR_FILENO) >= 0) {
    setenv("TERM", "xterm", 1);
    if (getenv("CAIRN_FAULTS_HOLD") != nullptr) setenv("LD_PRELOAD", library.c_str(), 1);
    execv(arguments[0], arguments.data());
  }
  _exit(kNotStarted);
}

}  // namespace

Running::Running(const std::vector<std::string>& arguments, const fs::path& folder, Errors errors) {
  std::vector<std::string> words{program_file().string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  int of_child = -1;
  if (errors == Errors::to_terminal) {
    EXPECT_EQ(openpty(&terminal_, &of_child, nullptr, nullptr, nullptr), 0);
    fcntl(terminal_, F_SETFD, FD_CLOEXEC);
    fcntl(terminal_, F_SETFL, O_NONBLOCK);
  }
  const std::string library = faults_library();
  process_ = fork();
  if (process_ == 0) become(words, folder, files_ / "out", files_ / "err", of_child, library);
  if (of_child >= 0) close(of_child);
}

Running::~Running() {
  if (!has_ended()) {
    kill(process_, SIGKILL);
    waitpid(process_, &status_, 0);
  }
  if (terminal_ >= 0) close(terminal_);
}

void Running::send(int signal) const { EXPECT_EQ(kill(process_, signal), 0); }

bool Running::has_ended() {
  if (!has_ended_) has_ended_ = waitpid(process_, &status_, WNOHANG) == process_;
  return has_ended_;
}

bool Running::wait_until(const std::function<bool()>& is_so) {
  const auto begin = std::chrono::steady_clock::now();
  while (!is_so()) {
    if (has_ended()) return is_so();
    if (std::chrono::steady_clock::now() - begin > kPatience) {
      ADD_FAILURE() << "timed out; stderr: " << err();
      return false;
    }
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

bool Running::handles_signals() const {
  std::ifstream in("/proc/" + std::to_string(process_) + "/status");
  for (std::string line; std::getline(in, line);)
    if (line.starts_with("SigCgt:")) return (std::stoull(line.substr(7), nullptr, 16) >> (SIGINT - 1) & 1) != 0;
  return false;
}

void Running::read_terminal() {
  char bytes[4096];
  for (ssize_t count = 0; terminal_ >= 0 && (count = read(terminal_, bytes, sizeof bytes)) > 0;)
    shown_.append(bytes, static_cast<std::size_t>(count));
}

std::string Running::err() {
  read_terminal();
  return terminal_ >= 0 ? shown_ : read_bytes(files_ / "err");
}

Ran Running::end() {
  EXPECT_TRUE(wait_until([&] {
    read_terminal();  // so that the program does not block on a full terminal
    return has_ended();
  }));
  return {WIFEXITED(status_) ? WEXITSTATUS(status_) : 1000 + status_, read_bytes(files_ / "out"), err()};
}

Blocking::Blocking(const fs::path& file) : mark_(folder_.path() / "held") {
  if (!fs::exists(file)) std::ofstream(file) << "";
  setenv("CAIRN_FAULTS_HOLD", fs::absolute(file).c_str(), 1);
  setenv("CAIRN_FAULTS_HELD", mark_.c_str(), 1);
}

Blocking::~Blocking() {
  for (const char* name : {"CAIRN_FAULTS_HOLD", "CAIRN_FAULTS_HELD"}) unsetenv(name);
}

bool Blocking::holds_a_reader() const { return fs::exists(mark_); }

}  // namespace cairn
