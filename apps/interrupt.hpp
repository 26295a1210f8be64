// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// SIGINT (Ctrl-C), SIGTERM and SIGHUP, from the first line of main to the last.
//
// A signal ends the program at once, with one line on stderr, exit code 130 and nothing half written, unless an
// Interrupt lives and its work is worth finishing: then the first signal asks for that, and the second ends at once.
#pragma once

#include <functional>
#include <string>

namespace cairn::apps {

/// Takes over these signals; to be called before all else. A SIGHUP that is ignored, as under nohup, stays so.
void answer_signals();
/// Blocks where a signal is ending the program, so that nobody else ends it in another way meanwhile.
void wait_while_ending();

/// Printed at the first signal that comes while the files of a result are written.
constexpr const char* kWriting = "writing the files of the result; once more ends at once";

/// Work that a signal asks to finish. One lives at a time; a signal that an earlier one has not seen is seen by the
/// next.
class Interrupt {
 public:
  /// From when on there is something to finish.
  enum class Worth { now, later };
  /// `said`: printed at the first signal; empty: nothing.
  explicit Interrupt(Worth worth, std::string said = "finishing what came so far; once more ends at once");
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  /// From now on there is something to finish.
  void is_worth_finishing();
  /// What the first signal prints from now on.
  void say(std::string said);
  [[nodiscard]] bool requested() const;
};

/// The last line of a program that ends at once while this lives, made then. They may be nested; the newest counts.
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
