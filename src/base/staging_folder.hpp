// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <optional>

#include "base/system_file.hpp"
#include "base/unfinished.hpp"

namespace cairn {

/// Staging folder `.cairn-PID.NAME` beside a folder NAME: created exclusively, with a marker file locked during this
/// object's lifetime, and `NAME/` for the new content.
class StagingFolder {
 public:
  /// Requires the parent folder of `destination`. Throws SystemError.
  explicit StagingFolder(const std::filesystem::path& destination);
  /// Removes the staging folder with its remaining content.
  ~StagingFolder();
  StagingFolder(const StagingFolder&) = delete;
  StagingFolder& operator=(const StagingFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& content() const { return content_; }
  /// Moves the content to `destination`, on the same disk. An existing folder is exchanged atomically if the file
  /// system supports it; else it is moved aside first, and back if the content cannot be moved. The old folder is
  /// removed at the end. Throws SystemError; `destination` is then unchanged. Throws std::runtime_error if the old
  /// folder cannot be moved back: the message names its location, and it is kept.
  void replace_folder(const std::filesystem::path& destination);

 private:
  std::filesystem::path folder_, content_;
  std::optional<Unfinished> unfinished_;
  std::unique_ptr<SystemFile> mark_;
  bool is_removed_ = true;  // false: the destructor keeps the folder
};

/// Removes the staging folder of a killed program, after moving back an old folder left aside. Keeps a folder without
/// the marker file, or with a running program.
void remove_left_staging(const std::filesystem::path& folder);

}  // namespace cairn
