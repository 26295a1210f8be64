// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <span>
#include <string>

namespace cairn {

/// Clauses of the errors of a RuntimeLibrary.
struct LibraryErrors {
  std::string need;     // start of each error: "videos need FFmpeg"
  std::string install;  // remedy for a missing library
  std::string update;   // remedy for an old library; may be empty
};

/// Shared library loaded with dlopen, until the end of the program: the program also starts without it.
class RuntimeLibrary {
 public:
  /// Loads the first file found in the system's search path. Throws std::runtime_error with the first file's name and
  /// the remedy.
  RuntimeLibrary(std::span<const std::string> files, LibraryErrors errors);
  /// Sets `function` to the library's function. Throws std::runtime_error if the library lacks it.
  template <class Function>
  void find(const char* name, Function*& function) const {
    function = reinterpret_cast<Function*>(address_of(name));
  }

 private:
  [[nodiscard]] void* address_of(const char* name) const;
  void* library_ = nullptr;
  LibraryErrors errors_;
};

}  // namespace cairn
