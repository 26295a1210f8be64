// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings packed as .zip.
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "base/file_lock.hpp"
#include "base/unfinished.hpp"

namespace cairn {

/// True if the name is a packed recording.
[[nodiscard]] bool is_zip(const std::string& name);

/// Content of an archive, in a temporary folder removed with this object. The folder is in TMPDIR, else in /var/tmp,
/// because /tmp may be in memory. The constructor first removes leftover folders of killed programs.
class UnpackedZip {
 public:
  /// Throws std::runtime_error if the file is no archive, is encrypted, has paths outside of its folder, unpacks to
  /// more than the free disk space, or is empty.
  explicit UnpackedZip(const std::filesystem::path& archive);
  ~UnpackedZip();
  UnpackedZip(const UnpackedZip&) = delete;
  UnpackedZip& operator=(const UnpackedZip&) = delete;

  /// Returns the folder or file to open, below folders with a single subfolder as their only content.
  [[nodiscard]] std::string recording() const;
  /// Lists the damaged files in one line; their readable parts are unpacked.
  [[nodiscard]] const std::optional<std::string>& damage() const { return damage_; }
  /// Replaces the temporary folder's name in a message by the archive's.
  [[nodiscard]] std::string by_archive_name(std::string text) const;
  /// Calls `read` and rethrows its errors with the archive's name.
  template <class Read>
  auto with_archive_name(const Read& read) const {
    try {
      return read(recording());
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(by_archive_name(error.what()));
    }
  }

 private:
  void unpack();
  std::filesystem::path archive_, folder_;
  Unfinished unfinished_;          // the temporary folder
  FileLock lock_;                  // of the folder, marks it as used for other programs
  std::filesystem::path content_;  // folder with the archive's name, because some layouts are recognized by name
  std::optional<std::string> damage_;
};

/// Returns the same object as the previous call if the file is unchanged. The last archive is kept until another is
/// requested or the program ends, because a program opens a recording more than once.
[[nodiscard]] std::shared_ptr<const UnpackedZip> unpacked(const std::filesystem::path& archive);

}  // namespace cairn
