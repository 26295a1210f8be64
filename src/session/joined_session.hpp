// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A session made of others, whose keyframes and submaps stay where they are.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/pose_graph.hpp"
#include "map/pairs.hpp"
#include "session/session_files.hpp"

namespace cairn {

/// Puts sessions together one after the other. Of each, the atlas stays in memory.
class JoinedSession {
 public:
  /// `writer`: of the session that is made; what a map was still fusing into is written there as a submap.
  explicit JoinedSession(SessionWriter& writer) : writer_(writer) {}

  /// Adds the map in a session's folder. Parts of a recording follow each other in the order of its frames; they may
  /// have frames in common. Throws std::runtime_error for a map of another camera or other voxels than the first one,
  /// and for one that is made of others itself.
  void add(const std::filesystem::path& session, std::size_t recording);
  /// Loops between two of them, by their numbers and their own keyframes.
  void add_loops(std::size_t first, std::size_t second, std::vector<Loop> loops);

  struct Report {
    int loops = 0, believed = 0, overlaps = 0;
    int pairs = 0, aligned = 0;  // keyframes of two maps that lie near each other; of them those that agree with all
    OptimiseReport graph;
  };
  /// Lays all to each other, see join_pieces(), and moves the keyframes to where loops and tracking agree best; then
  /// the same with keyframes of two maps aligned that see much of the same where they lie now. `recordings`: that there
  /// are, also behind those of the last map.
  [[nodiscard]] Report join(std::size_t recordings = 0, int device = -1);
  /// Keyframes of maps that an earlier session had as well stay exactly where they were in it, where they would hardly
  /// move; the whole is laid so that most of them do. Also how the map is turned stays then. Returns by map how far its
  /// keyframes would have moved, metres at most; nothing for one that is new.
  [[nodiscard]] std::vector<std::optional<double>> keep(const ReadSession& earlier);
  /// Writes the session; with `gather` keyframes and submaps are copied into it, so that it needs no other one.
  void write(bool gather = false);
  /// Whether a map is part of the largest piece.
  [[nodiscard]] bool is_joined(std::size_t map) const;

  struct Map {
    PartFiles files;
    std::size_t recording = 0, frames = 0;
    std::size_t submaps = 0;  // with the one that was written beside the others
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
  std::vector<FusedFrames> frames_;  // of each map, by its own keyframes
  std::vector<FileLock> holds_;
  std::vector<Loop> loops_;  // between maps
};

}  // namespace cairn
