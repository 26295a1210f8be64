// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Failures that are told and do not end a run.
#pragma once
#include <algorithm>
#include <exception>
#include <string>
#include <vector>

namespace cairn {

/// What failed on the way and was left out, in the order in which it happened; nothing is told twice.
class Warnings {
 public:
  void add(const std::string& text) {
    if (std::find(all_.begin(), all_.end(), text) == all_.end()) all_.push_back(text);
  }
  /// Runs a stage that the map can do without; if it fails, that is told with what follows from it. Returns whether it
  /// did not.
  template <class Stage>
  bool attempt(const std::string& what_follows, const Stage& stage) {
    try {
      stage();
      return true;
    } catch (const std::exception& error) {
      add(error.what() + ("; " + what_follows));
      return false;
    }
  }
  [[nodiscard]] const std::vector<std::string>& all() const { return all_; }

 private:
  std::vector<std::string> all_;
};

}  // namespace cairn
