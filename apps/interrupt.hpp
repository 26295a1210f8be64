// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Handles SIGINT (Ctrl-C), SIGTERM and SIGHUP from the first line of main to the last.
//
// A signal ends the program at once, with one line on stderr, exit code 130 and no partial files. If an Interrupt
// exists and its work is worth finishing, the first signal requests a regular end, and the second ends at once.
#pragma once

#include <functional>
#include <string>

namespace cairn::apps {

/// Installs the signal handling; must be called first in main. An ignored SIGHUP, as under nohup, stays ignored.
void answer_signals();
/// Blocks if a signal is ending the program, so that no other thread ends it differently.
void wait_while_ending();

/// Message for the first signal while result files are written.
constexpr const char* kWriting = "writing the files of the result; once more ends at once";

/// Work that a signal can ask to finish. One instance at a time; a signal not seen by one instance is seen by the next.
class Interrupt {
 public:
  /// When the work is worth finishing: at once, or after is_worth_finishing().
  enum class Worth { now, later };
  /// `said` is printed at the first signal; empty: no message.
  explicit Interrupt(Worth worth, std::string said = "finishing what came so far; once more ends at once");
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  /// Marks the work as worth finishing.
  void is_worth_finishing();
  /// Sets the message of the first signal.
  void say(std::string said);
  [[nodiscard]] bool requested() const;
};

/// Last line of a program that ends at once while this object exists; `words` is called at that time. Nested objects:
/// the newest is used.
class LastWords {
 public:
  explicit LastWords(std::function<std::string()> words);
  ~LastWords();
  LastWords(const LastWords&) = delete;
  LastWords& operator=(const LastWords&) = delete;

 private:
  std::function<std::string()> before_;
};

}  // namespace cairn::apps
