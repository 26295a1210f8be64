// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once

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

}  // namespace cairn::apps
