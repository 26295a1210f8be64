// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a command reads against what it writes: no output is an input, holds one, or is inside one.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn::apps {

/// A command's inputs. Files are compared by device and inode, so that links, other spellings and mounts of the same
/// folder are the same.
class Inputs {
 public:
  /// A file, or a folder with all that is in it; nothing for an empty path, or where nothing is, as at the name of a
  /// known camera.
  Inputs& add(const std::filesystem::path& path);
  /// A recording as open_source takes it; of a plan's part its recording as well.
  Inputs& add_recording(const std::string& sequence);
  /// A map, or a plan: the files of it that maps are opened from. Others may be written into its folder.
  Inputs& add_map(const std::filesystem::path& map);

  /// Throws std::runtime_error where an output file is an input or inside one; an empty path is none.
  void expect_apart_from_file(const std::filesystem::path& output) const;
  /// Throws std::runtime_error where an output folder is an input, inside one, or holds one.
  void expect_apart_from_folder(const std::filesystem::path& output) const;

 private:
  struct Input {
    std::filesystem::path path;
    bool is_whole = true;  // all that is in it is read
  };
  void expect_outside(const std::filesystem::path& output) const;
  std::vector<Input> inputs_;
};

}  // namespace cairn::apps
