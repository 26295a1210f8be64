// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "interrupt.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <mutex>
#include <thread>
#include <utility>

#include "cairn/unfinished.hpp"
#include "console.hpp"

namespace cairn::apps {
namespace {

constexpr int kInterrupted = 130;  // shell convention: 128 + SIGINT

std::array<int, 2> wake;  // pipe from the signal handler to the answering thread

/// Response to signals, shared by all threads.
struct Answers {
  std::mutex mutex;
  bool is_worth_finishing = false;
  std::string said;
  std::function<std::string()> last_words;
  std::atomic<int> requests = 0;  // signals received
  std::atomic<int> observed = 0;  // signals observed by requested()
  std::atomic<int> seen = 0;      // signals seen by an Interrupt that has ended
};

/// Never destroyed, because the answering thread runs until the process ends.
Answers& answers() {
  static auto* const all = new Answers;
  return *all;
}

void on_signal(int signal) {
  const int error = errno;
  const auto byte = static_cast<unsigned char>(signal);
  [[maybe_unused]] const auto written = write(wake[1], &byte, 1);
  errno = error;
}

/// Replaces a progress line and the terminal's "^C".
void tell(const std::string& words) {
  clear_line();
  const std::string line = (terminal_of(STDERR_FILENO).is_live ? "\r\x1b[K" : "") + words + "\n";
  [[maybe_unused]] const auto written = write(STDERR_FILENO, line.data(), line.size());
}

/// Redirects output of a closed terminal to /dev/null, so that remaining files can still be written.
void leave_terminal() {
  const int nowhere = open("/dev/null", O_RDWR | O_CLOEXEC);
  for (const int descriptor : {STDOUT_FILENO, STDERR_FILENO})
    if (nowhere >= 0 && isatty(descriptor) == 0 && errno == EIO) dup2(nowhere, descriptor);
}

void answer(int signal) {
  Answers& a = answers();
  const std::lock_guard lock(a.mutex);
  if (signal == SIGHUP) leave_terminal();
  if (a.is_worth_finishing && a.requests == a.seen) {
    ++a.requests;
    if (!a.said.empty()) tell(a.said);
    return;
  }
  std::string words = "cairn: interrupted before it was done";
  if (a.last_words) try {
      words = a.last_words();
    } catch (const std::exception&) {  // the line above suffices
    }
  remove_unfinished();
  tell(words);
  _exit(kInterrupted);
}

[[noreturn]] void wait_for_signals() {
  while (true) {
    unsigned char signal = 0;
    if (read(wake[0], &signal, 1) == 1) answer(signal);
  }
}

}  // namespace

void answer_signals() {
  if (pipe2(wake.data(), O_CLOEXEC) != 0) return;  // signals keep their default action
  (void)answers();
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    sigaction(signal, nullptr, &before);
    if (signal != SIGHUP || before.sa_handler != SIG_IGN) sigaction(signal, &action, nullptr);
  }
  std::thread(wait_for_signals).detach();
}

void wait_while_ending() { const std::lock_guard lock(answers().mutex); }

Interrupt::Interrupt(Worth worth, std::string said) {
  const std::lock_guard lock(answers().mutex);
  answers().is_worth_finishing = worth == Worth::now;
  answers().said = std::move(said);
}

Interrupt::~Interrupt() {
  const std::lock_guard lock(answers().mutex);
  answers().is_worth_finishing = false;
  answers().seen.store(answers().observed);
}

void Interrupt::is_worth_finishing() {
  const std::lock_guard lock(answers().mutex);
  answers().is_worth_finishing = true;
}

void Interrupt::say(std::string said) {
  const std::lock_guard lock(answers().mutex);
  answers().said = std::move(said);
}

bool Interrupt::requested() const {
  Answers& a = answers();
  if (a.requests <= a.seen) return false;
  a.observed.store(a.requests);
  return true;
}

LastWords::LastWords(std::function<std::string()> words) {
  const std::lock_guard lock(answers().mutex);
  before_ = std::exchange(answers().last_words, std::move(words));
}

LastWords::~LastWords() {
  const std::lock_guard lock(answers().mutex);
  answers().last_words = std::move(before_);
}

}  // namespace cairn::apps
