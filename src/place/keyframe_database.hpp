// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "place/features.hpp"

namespace cairn {

/// A keyframe as it can be recognised.
struct DatabaseEntry {
  /// In the frame in which the camera is tracked now; none for keyframes of other components, whose place in it nobody
  /// knows. Not the keyframe's own pose in its submap: a recording that goes on in a map is tracked in the world's
  /// frame.
  std::optional<Eigen::Isometry3d> tracked_from_camera;
  Features features;
};

/// Keyframes, and an index of their corners that finds those alike without comparing with each: tables of keyframes by
/// some bits of the descriptors (locality-sensitive hashing: Gionis, Indyk & Motwani 1999), where corners seen
/// everywhere say little (Sivic & Zisserman 2003). It grows with each keyframe; no vocabulary is trained.
class KeyframeDatabase {
 public:
  KeyframeDatabase();
  void add(DatabaseEntry entry);
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  [[nodiscard]] const DatabaseEntry& operator[](std::size_t i) const { return entries_[i]; }
  [[nodiscard]] DatabaseEntry& operator[](std::size_t i) { return entries_[i]; }

  struct Candidate {
    std::size_t entry;
    float score;  // larger: more corners in common
  };
  /// At most `count` of the entries from `begin` to `end`, the most similar first.
  [[nodiscard]] std::vector<Candidate> query(const Features& features, std::size_t count, std::size_t begin = 0,
                                             std::size_t end = std::numeric_limits<std::size_t>::max()) const;

 private:
  static constexpr std::size_t kTables = 8, kBits = 16;
  static std::uint32_t key(std::size_t table, const std::array<std::uint8_t, 32>& descriptor);
  std::vector<DatabaseEntry> entries_;
  std::vector<std::vector<std::uint32_t>> buckets_;  // entries, by table and key
};

}  // namespace cairn
