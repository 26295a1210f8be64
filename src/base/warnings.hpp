// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Warnings: reported failures that do not end a run.
#pragma once
#include <algorithm>
#include <exception>
#include <string>
#include <vector>

namespace cairn {

/// List of failed and skipped stages, in order of occurrence, without duplicates.
class Warnings {
 public:
  void add(const std::string& text) {
    if (std::find(all_.begin(), all_.end(), text) == all_.end()) all_.push_back(text);
  }
  /// Runs an optional stage; a failure adds a warning with its consequence. Returns true on success.
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
