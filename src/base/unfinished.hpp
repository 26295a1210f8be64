// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Cleanup of incomplete files and folders when a program ends early.
#pragma once
#include <filesystem>

namespace cairn {

/// Registers a file or folder as incomplete output, worthless until finished. The destructor unregisters and keeps the
/// file; remove_unfinished deletes it.
class Unfinished {
 public:
  enum class Kind {
    all,   ///< the file, or the folder with its contents
    empty  ///< the folder, if it is empty
  };
  /// Blocks forever once remove_unfinished has been called.
  explicit Unfinished(std::filesystem::path path, Kind kind = Kind::all);
  ~Unfinished();
  Unfinished(Unfinished&& other) noexcept;
  Unfinished(const Unfinished&) = delete;
  Unfinished& operator=(const Unfinished&) = delete;
  Unfinished& operator=(Unfinished&&) = delete;

 private:
  int number_ = 0;  // 0: moved away
};

/// Deletes all registered files and folders, newest first. For immediate exit, from any thread except a signal handler;
/// other threads may still be writing.
void remove_unfinished() noexcept;

}  // namespace cairn
