// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings of a building cut into parts, each small enough for one run, which are mapped on their own and put
// together afterwards. A plan is a folder:
//
//   PLAN/plan.json             what recordings there are, and their parts
//   PLAN/parts/017/part.json   a part: its folder opens as a recording does (open_source)
//   PLAN/maps/017/             its map
//   PLAN/loops/003-017.json    where two maps see the same
//   PLAN/session/, ...         the map of all, see docs/formats.md
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

struct PartsPlan {
  /// A recording as open_source takes it, no sensor; files by their whole path.
  struct Recording {
    std::string name;
    int frames = 0;
  };
  /// Frames [begin, end) of a recording, counted from 0. What follows on it in the same recording begins `overlap`
  /// frames before its end.
  struct Part {
    std::string name;  ///< three digits or more: 000, 001, ...
    std::size_t recording = 0;
    int begin = 0, end = 0;
  };
  int frames_per_part = 3000, overlap = 150;
  std::vector<Recording> recordings;
  std::vector<Part> parts;  ///< of a recording in the order of its frames
};

/// Cuts recordings into parts of equal length, of frames_per_part and overlap at most, and writes plan.json and each
/// part.json, whole or not at all. A plan that is there grows: recordings that it has stay as they are, with their
/// parts' names, and its files are not touched where nothing of them changes. Throws std::runtime_error for a recording
/// that cannot be read, is a sensor, or has another number of frames than the plan knows, for two of different cameras,
/// where `folder` holds a map, and where `options`, of which the lists are not looked at, differ from those of the plan
/// that is there.
PartsPlan plan_parts(const std::vector<std::string>& recordings, const std::filesystem::path& folder,
                     const PartsPlan& options);

/// Throws std::runtime_error with what is missing or damaged: no plan, or one of another version.
[[nodiscard]] PartsPlan read_plan(const std::filesystem::path& folder);

/// Frame::index of the first frame of a recording, by its name: 0, but of a part, whose frames are its recording's.
/// Ranges (SourceOptions::range) count from it.
[[nodiscard]] int first_index(const std::string& recording);

}  // namespace cairn
