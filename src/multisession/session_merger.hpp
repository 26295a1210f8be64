// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Session merged from other sessions; their keyframes and submaps stay in place on disk.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapping/pose_graph.hpp"
#include "loop_closing/pairs.hpp"
#include "session/session_files.hpp"

namespace cairn {

/// Merges sessions successively. Keeps the atlas of each in memory.
class SessionMerger {
 public:
  /// `writer`: of the merged session. The active volume of a map is written there as a submap.
  explicit SessionMerger(SessionWriter& writer) : writer_(writer) {}

  /// Adds the map in a session's folder. Segments of a recording follow in frame order and may share frames. Throws
  /// std::runtime_error if the camera or the voxel options differ from the first map, or if the map is itself merged
  /// from others.
  void add(const std::filesystem::path& session, std::size_t recording);
  /// Adds loops between two maps, by map number and each map's own keyframe numbers.
  void add_loops(std::size_t first, std::size_t second, std::vector<Loop> loops);

  struct Report {
    int loops = 0, inliers = 0, overlaps = 0;
    int pairs = 0, aligned = 0;  // nearby keyframes of two maps; pairs whose alignment agrees with the rest
    OptimizeReport graph;
  };
  /// Aligns all maps to each other, see merge_components(), and optimizes the keyframe poses. Then aligns keyframes of
  /// two maps that overlap at the new poses, and optimizes again. `recordings`: total count, including recordings after
  /// the last map.
  [[nodiscard]] Report merge(std::size_t recordings = 0, int device = -1);
  /// Restores the poses of keyframes also present in an earlier session, if they moved only slightly; first aligns the
  /// new world with the earlier world, so that as many keyframes as possible move only slightly. Keeps the gravity
  /// direction as well. Returns, by map, how far its keyframes would have moved, meters at most; nullopt for a new map.
  [[nodiscard]] std::vector<std::optional<double>> restore_poses(const ReadSession& earlier);
  /// Writes the session. With `gather`, copies keyframes and submaps into the session, to make it self-contained.
  void write(bool gather = false);
  /// True if a map is part of the largest component.
  [[nodiscard]] bool is_merged(std::size_t map) const;

  struct Map {
    SourceMapFiles files;
    std::size_t recording = 0, frames = 0;
    std::size_t submaps = 0;  // including the submap written beside the map's own
    std::string id;           // see map_id()
  };
  [[nodiscard]] const std::vector<Map>& maps() const { return maps_; }
  [[nodiscard]] const SessionState& state() const { return state_; }

 private:
  void add_frames(std::size_t map);
  [[nodiscard]] std::vector<Loop> overlaps(std::size_t map) const;
  [[nodiscard]] std::vector<KeyframePair> pairs(const std::vector<std::size_t>& map_of) const;

  SessionWriter& writer_;
  SessionState state_;
  std::vector<Map> maps_;
  std::vector<FusedFrames> frames_;  // by map, with the map's own keyframe numbers
  std::vector<FileLock> holds_;
  std::vector<Loop> loops_;  // between maps
};

}  // namespace cairn
