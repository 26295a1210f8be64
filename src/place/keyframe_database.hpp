// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "place/features.hpp"
#include "place/inverted_index.hpp"

namespace cairn {

/// A keyframe as it can be recognised.
struct DatabaseEntry {
  /// In the frame in which the camera is tracked now; none for keyframes of other components, whose place in it nobody
  /// knows. Not the keyframe's own pose in its submap: a recording that goes on in a map is tracked in the world's
  /// frame.
  std::optional<Eigen::Isometry3d> tracked_from_camera;
};

/// Finds keyframes alike by their corners without comparing with each: an index of keyframes by some bits of the
/// descriptors (locality-sensitive hashing: Gionis, Indyk & Motwani 1999), where corners seen everywhere say little
/// (Sivic & Zisserman 2003). It grows with each keyframe; no vocabulary is trained. The corners themselves it does not
/// keep.
class KeyframeDatabase {
 public:
  /// `folder`: where the index of many keyframes waits, in files without names.
  explicit KeyframeDatabase(std::filesystem::path folder = std::filesystem::temp_directory_path());
  void add(const std::optional<Eigen::Isometry3d>& tracked_from_camera, const Features& features);
  /// Adds one that is not found until index() has got its corners, and those of all before it.
  void add(const std::optional<Eigen::Isometry3d>& tracked_from_camera) { entries_.push_back({tracked_from_camera}); }
  void index(const Features& features);
  /// So many can be found.
  [[nodiscard]] std::size_t indexed() const { return corners_.size(); }
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
  /// At most `count` of those that lie in the frame of tracking, the most similar first.
  [[nodiscard]] std::vector<Candidate> query_tracked(const Features& features, std::size_t count) const;
  [[nodiscard]] InvertedIndex::Bytes bytes() const { return index_.bytes(); }

 private:
  [[nodiscard]] std::vector<Candidate> most_similar(const Features& features, std::size_t count,
                                                    const std::function<bool(std::size_t)>& takes_part) const;
  std::vector<DatabaseEntry> entries_;
  std::vector<float> corners_;  // the square root of their number, by entry
  InvertedIndex index_;
};

}  // namespace cairn
