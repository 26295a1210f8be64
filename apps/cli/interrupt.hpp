// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Handles SIGINT (Ctrl-C), SIGTERM and SIGHUP from the first line of main to the last.
//
// A signal ends the program at once, with one line on stderr, exit code 130 and no partial files. If an Interrupt
// exists and its work is worth finishing, the first signal requests a regular end, and the second ends at once. Work of
// two steps takes a signal for each, and ends at once at the third.
#pragma once

#include <functional>
#include <string>

namespace cairn::apps {

/// Installs the signal handling; must be called first in main. An ignored SIGHUP, as under nohup, stays ignored.
void install_signal_handlers();
/// Blocks if a signal is ending the program, to keep other threads from ending it differently.
void block_if_exiting();

/// Message for the first signal while frames are read.
constexpr const char* kFinishing = "finishing with the frames so far; interrupt again to end at once";
/// Message for the first signal while result files are written.
constexpr const char* kWriting = "writing the result; interrupt again to end at once";

/// Work to finish after a signal. One instance at a time; a signal not seen by one instance is seen by the next.
class Interrupt {
 public:
  /// When the work is worth finishing: at once, or after allow_graceful_exit().
  enum class Graceful { now, later };
  /// `message` is printed at the first signal; empty: no message.
  explicit Interrupt(Graceful graceful, std::string message = kFinishing);
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  /// Marks the work as worth finishing.
  void allow_graceful_exit();
  /// Sets the message of the first signal.
  void set_message(std::string message);
  /// Accepts a second signal, for the next step (begin_next_step), with its message; empty: the second ends at once.
  void set_next_message(std::string message);
  /// Begins the next step: requested() returns true at a second signal, which may have arrived before.
  void begin_next_step(std::string message);
  [[nodiscard]] bool requested() const;
};

/// Last line of a program that ends at once while this object exists; `text` is called at that time. Nested objects:
/// the newest is used.
class ExitMessage {
 public:
  explicit ExitMessage(std::function<std::string()> text);
  ~ExitMessage();
  ExitMessage(const ExitMessage&) = delete;
  ExitMessage& operator=(const ExitMessage&) = delete;

 private:
  std::function<std::string()> before_;
};

}  // namespace cairn::apps
