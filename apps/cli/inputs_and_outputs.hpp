// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Checks that no output of a command is an input, contains an input, or is inside an input.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn::apps {

/// Inputs of a command. Compares files by device and inode, so that links, other spellings and other mounts of a folder
/// match.
class Inputs {
 public:
  /// Adds a file, or a folder with its contents. Ignores empty and missing paths, such as the name of a known camera.
  Inputs& add(const std::filesystem::path& path);
  /// Adds a recording as accepted by open_source; for a project's segment also its recording.
  Inputs& add_recording(const std::string& sequence);
  /// Adds the files of a map or project that maps are opened from. Other files may be written into its folder.
  Inputs& add_map(const std::filesystem::path& map);

  /// Throws std::runtime_error if an output file is an input or inside an input. Ignores an empty path.
  void check_output_file(const std::filesystem::path& output) const;
  /// Throws std::runtime_error if an output folder is an input, is inside an input, or contains an input.
  void check_output_folder(const std::filesystem::path& output) const;

 private:
  struct Input {
    std::filesystem::path path;
    bool has_contents = true;  // false: only the path itself is an input
  };
  void check_outside(const std::filesystem::path& output) const;
  std::vector<Input> inputs_;
};

}  // namespace cairn::apps
