// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/interrupt.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <mutex>
#include <thread>
#include <utility>

#include "base/unfinished.hpp"
#include "cli/console.hpp"

namespace cairn::apps {
namespace {

constexpr int kInterruptedExitCode = 130;  // shell convention: 128 + SIGINT

std::array<int, 2> wake_pipe;  // pipe from the signal handler to the answering thread

/// Response to signals, shared by all threads.
struct SignalState {
  std::mutex mutex;
  bool is_graceful = false;
  std::string message, next_message;  // of the first signal, and of the second if the next step accepts it
  std::function<std::string()> exit_message;
  std::atomic<int> requests = 0;  // signals received
  std::atomic<int> observed = 0;  // signals observed by requested()
  std::atomic<int> handled = 0;   // signals handled by an Interrupt that has ended
};

/// Never destroyed, because the answering thread runs until the process ends.
SignalState& signal_state() {
  static auto* const all = new SignalState;
  return *all;
}

void on_signal(int signal) {
  const int error = errno;
  const auto byte = static_cast<unsigned char>(signal);
  [[maybe_unused]] const auto written = write(wake_pipe[1], &byte, 1);
  errno = error;
}

/// Replaces a progress line and the terminal's "^C".
void print_line(const std::string& text) {
  clear_line();
  const std::string line = (terminal_of(STDERR_FILENO).is_live ? "\r\x1b[K" : "") + text + "\n";
  [[maybe_unused]] const auto written = write(STDERR_FILENO, line.data(), line.size());
}

/// Redirects output of a closed terminal to /dev/null, so that remaining files can still be written.
void detach_terminal() {
  const int null_device = open("/dev/null", O_RDWR | O_CLOEXEC);
  for (const int descriptor : {STDOUT_FILENO, STDERR_FILENO})
    if (null_device >= 0 && isatty(descriptor) == 0 && errno == EIO) dup2(null_device, descriptor);
}

void handle_signal(int signal) {
  SignalState& a = signal_state();
  const std::lock_guard lock(a.mutex);
  if (signal == SIGHUP) detach_terminal();
  const int pending = a.requests - a.handled;
  if (a.is_graceful && (pending == 0 || (pending == 1 && !a.next_message.empty()))) {
    ++a.requests;
    if (const std::string& message = pending == 0 ? a.message : a.next_message; !message.empty()) print_line(message);
    return;
  }
  std::string text = "cairn: interrupted before completion";
  if (a.exit_message) try {
      text = a.exit_message();
    } catch (const std::exception&) {  // the line above suffices
    }
  remove_unfinished();
  print_line(text);
  _exit(kInterruptedExitCode);
}

[[noreturn]] void wait_for_signals() {
  while (true) {
    unsigned char signal = 0;
    if (read(wake_pipe[0], &signal, 1) == 1) handle_signal(signal);
  }
}

}  // namespace

void install_signal_handlers() {
  if (pipe2(wake_pipe.data(), O_CLOEXEC) != 0) return;  // signals keep their default action
  (void)signal_state();
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

void block_if_exiting() { const std::lock_guard lock(signal_state().mutex); }

Interrupt::Interrupt(Graceful graceful, std::string message) {
  const std::lock_guard lock(signal_state().mutex);
  signal_state().is_graceful = graceful == Graceful::now;
  signal_state().message = std::move(message);
}

Interrupt::~Interrupt() {
  const std::lock_guard lock(signal_state().mutex);
  signal_state().is_graceful = false;
  signal_state().next_message.clear();
  signal_state().handled.store(signal_state().observed);
}

void Interrupt::allow_graceful_exit() {
  const std::lock_guard lock(signal_state().mutex);
  signal_state().is_graceful = true;
}

void Interrupt::set_message(std::string message) {
  const std::lock_guard lock(signal_state().mutex);
  signal_state().message = std::move(message);
}

void Interrupt::set_next_message(std::string message) {
  const std::lock_guard lock(signal_state().mutex);
  signal_state().next_message = std::move(message);
}

void Interrupt::begin_next_step(std::string message) {
  SignalState& a = signal_state();
  const std::lock_guard lock(a.mutex);
  if (a.requests > a.handled) ++a.handled;
  a.observed.store(a.handled);
  a.message = std::move(message);
  a.next_message.clear();
}

bool Interrupt::requested() const {
  SignalState& a = signal_state();
  if (a.requests <= a.handled) return false;
  a.observed.store(a.handled + 1);
  return true;
}

ExitMessage::ExitMessage(std::function<std::string()> text) {
  const std::lock_guard lock(signal_state().mutex);
  before_ = std::exchange(signal_state().exit_message, std::move(text));
}

ExitMessage::~ExitMessage() {
  const std::lock_guard lock(signal_state().mutex);
  signal_state().exit_message = std::move(before_);
}

}  // namespace cairn::apps
