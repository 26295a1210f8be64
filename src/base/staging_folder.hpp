// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <optional>

#include "base/system_file.hpp"
#include "cairn/unfinished.hpp"

namespace cairn {

/// A folder of the program's own, `.cairn-PID.NAME` beside a folder NAME: made exclusively, with a file that marks it
/// and is locked as long as this lives, and with `NAME/` for what is written.
class StagingFolder {
 public:
  /// The folder above `place` must exist. Throws SystemError.
  explicit StagingFolder(const std::filesystem::path& place);
  /// Removes all that is left in it.
  ~StagingFolder();
  StagingFolder(const StagingFolder&) = delete;
  StagingFolder& operator=(const StagingFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& content() const { return content_; }
  /// Moves the content to `place`, on the same disk. A folder there is exchanged for it in one step where the disk can
  /// do that; else it is moved aside first, and back where the content cannot take its place. It is removed once the
  /// content is there. Throws SystemError; `place` is then as it was. Throws std::runtime_error where it cannot be
  /// moved back: it names the folder that holds it, which stays.
  void take_the_place_of(const std::filesystem::path& place);

 private:
  std::filesystem::path folder_, content_;
  std::optional<Unfinished> unfinished_;
  std::unique_ptr<SystemFile> mark_;
  bool is_removed_ = true;  // with this
};

/// Removes a staging folder whose program was killed. A folder in it that had been moved aside is moved back first. One
/// without the mark, or with a living program, stays.
void remove_left_staging(const std::filesystem::path& folder);

}  // namespace cairn
