// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once

#include <string>

namespace cairn::apps {

/// While one exists, Ctrl-C and SIGTERM ask the work to finish; a second one ends the program at once with exit code
/// 130, as a kill would.
class Interrupt {
 public:
  /// `said` is printed at the first.
  explicit Interrupt(const char* said = "\nfinishing what came so far; once more ends at once\n");
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  [[nodiscard]] bool requested() const;
};

/// While one exists, Ctrl-C and SIGTERM end the program at once with exit code 130, and a last sentence. For work that
/// is not worth finishing: files are whole or not there at all times.
class EndAtOnce {
 public:
  explicit EndAtOnce(std::string said);
  ~EndAtOnce();
  EndAtOnce(const EndAtOnce&) = delete;
  EndAtOnce& operator=(const EndAtOnce&) = delete;

 private:
  std::string said_;
};

}  // namespace cairn::apps
