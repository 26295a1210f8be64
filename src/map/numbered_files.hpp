// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <filesystem>
#include <utility>
#include <vector>

namespace cairn {

/// Locations of files numbered from 0: in one folder, except for ranges of numbers owned by other maps, which have
/// their own folders and numbering.
class NumberedFiles {
 public:
  struct ExternalRange {
    std::size_t first = 0, count = 0;  // numbers here; in the other folder the range starts at 0
    std::filesystem::path folder;
  };
  struct Place {
    const std::filesystem::path& folder;
    std::size_t number;
  };

  /// `elsewhere`: sorted by number.
  NumberedFiles(std::filesystem::path folder = {}, std::vector<ExternalRange> elsewhere = {})
      : folder_(std::move(folder)), elsewhere_(std::move(elsewhere)) {}
  /// Folder for new files; empty: no folder.
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] Place operator[](std::size_t i) const {
    for (const ExternalRange& e : elsewhere_)
      if (i - e.first < e.count) return {e.folder, i - e.first};  // unsigned: false for i < e.first
    return {folder_, i};
  }
  [[nodiscard]] bool is_elsewhere(std::size_t i) const { return &(*this)[i].folder != &folder_; }

 private:
  std::filesystem::path folder_;
  std::vector<ExternalRange> elsewhere_;
};

/// Files of a source map of a merged map: the folder of its run, and the ranges of its keyframes and submaps in the
/// merged map.
struct SourceMapFiles {
  std::filesystem::path folder;
  std::size_t first_keyframe = 0, keyframes = 0, first_submap = 0, submaps = 0;
};

/// Locations of a run's keyframes and of its submaps.
[[nodiscard]] inline NumberedFiles keyframe_files(const std::filesystem::path& run,
                                                  const std::vector<SourceMapFiles>& source_maps = {}) {
  constexpr const char* kFolder = "keyframes";
  std::vector<NumberedFiles::ExternalRange> elsewhere;
  elsewhere.reserve(source_maps.size());
  for (const SourceMapFiles& source : source_maps)
    elsewhere.push_back({source.first_keyframe, source.keyframes, source.folder / kFolder});
  return {run.empty() ? run : run / kFolder, std::move(elsewhere)};
}
[[nodiscard]] inline NumberedFiles submap_files(const std::filesystem::path& run,
                                                const std::vector<SourceMapFiles>& source_maps = {}) {
  std::vector<NumberedFiles::ExternalRange> elsewhere;
  elsewhere.reserve(source_maps.size());
  for (const SourceMapFiles& source : source_maps)
    elsewhere.push_back({source.first_submap, source.submaps, source.folder});
  return {run, std::move(elsewhere)};
}

}  // namespace cairn
