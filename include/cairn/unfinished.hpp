// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Files and folders that are not whole yet, for a program that ends in the middle of its work.
#pragma once
#include <filesystem>

namespace cairn {

/// A file or folder that this program makes, and that has no value before it is whole. It stays when this object goes;
/// remove_unfinished removes it.
class Unfinished {
 public:
  enum class Kind {
    all,   ///< the file, or the folder with its content
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

/// Removes all that is unfinished, the newest first. For a program that ends at once, from any thread but a signal's
/// handler; other threads may still write.
void remove_unfinished() noexcept;

}  // namespace cairn
