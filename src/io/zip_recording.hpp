// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings that came packed as .zip.
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "base/file_lock.hpp"
#include "cairn/unfinished.hpp"

namespace cairn {

/// Whether a name is that of a packed recording.
[[nodiscard]] bool is_zip(const std::string& name);

/// What an archive holds, in a temporary folder that goes away with this. The folder is in TMPDIR, else in /var/tmp,
/// which lies on a disk where /tmp may lie in memory. Folders that killed programs have left there are removed first.
class UnpackedZip {
 public:
  /// Throws std::runtime_error for what is no archive, is encrypted, leads out of its folder, unpacks to more than the
  /// disk has room for, or holds nothing.
  explicit UnpackedZip(const std::filesystem::path& archive);
  ~UnpackedZip();
  UnpackedZip(const UnpackedZip&) = delete;
  UnpackedZip& operator=(const UnpackedZip&) = delete;

  /// The folder or file to open: below folders that hold nothing but one other.
  [[nodiscard]] std::string recording() const;
  /// Which of its files are damaged, in one line; they are there as far as they can be read.
  [[nodiscard]] const std::optional<std::string>& damage() const { return damage_; }
  /// What was said of the temporary folder, said of the archive.
  [[nodiscard]] std::string in_its_name(std::string text) const;
  /// Calls `read`, whose errors are told in the archive's name.
  template <class Read>
  auto told_in_its_name(const Read& read) const {
    try {
      return read(recording());
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(in_its_name(error.what()));
    }
  }

 private:
  void unpack();
  std::filesystem::path archive_, folder_;
  Unfinished unfinished_;          // the folder
  FileLock lock_;                  // of the folder, for others to see that it is in use
  std::filesystem::path content_;  // a folder of the archive's name, since some layouts are known by theirs
  std::optional<std::string> damage_;
};

/// The same as in the call before where it is still the same file. The last one stays until another is asked for or the
/// program ends, since a program opens a recording more than once.
[[nodiscard]] std::shared_ptr<const UnpackedZip> unpacked(const std::filesystem::path& archive);

}  // namespace cairn
