// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>
#include <vector>

#include "place/features.hpp"
#include "place/inverted_index.hpp"

namespace cairn {

/// Database entry of a keyframe.
struct DatabaseEntry {
  /// In the current frame of tracking; none for keyframes of other components, with unknown pose in this frame. Differs
  /// from the keyframe's pose in its submap: a recording that extends a map is tracked in the world frame.
  std::optional<Eigen::Isometry3d> tracked_from_camera;
};

/// Finds similar keyframes by their features without comparing all: an index of keyframes by some bits of the
/// descriptors (locality-sensitive hashing: Gionis, Indyk & Motwani 1999), where frequent features have little weight
/// (Sivic & Zisserman 2003). Grows with each keyframe and needs no trained vocabulary. The features themselves are not
/// stored. Several threads may query at once.
class KeyframeDatabase {
 public:
  /// `folder`: for the index of many keyframes, in unnamed files.
  explicit KeyframeDatabase(std::filesystem::path folder = std::filesystem::temp_directory_path());
  void add(const std::optional<Eigen::Isometry3d>& tracked_from_camera, const Features& features);
  /// Adds a keyframe with features that the next query waits for.
  void add(const std::optional<Eigen::Isometry3d>& tracked_from_camera, FutureFeatures features);
  /// Adds a keyframe that queries do not find before index() has received its features and those of all earlier
  /// keyframes.
  void add(const std::optional<Eigen::Isometry3d>& tracked_from_camera) { entries_.push_back({tracked_from_camera}); }
  void index(const Features& features);
  /// Number of keyframes available to queries.
  [[nodiscard]] std::size_t indexed() const;
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  [[nodiscard]] const DatabaseEntry& operator[](std::size_t i) const { return entries_[i]; }
  [[nodiscard]] DatabaseEntry& operator[](std::size_t i) { return entries_[i]; }

  struct Candidate {
    std::size_t entry;
    float score;  // larger: more features in common
  };
  /// At most `count` of the entries from `begin` to `end`, most similar first.
  [[nodiscard]] std::vector<Candidate> query(const Features& features, std::size_t count, std::size_t begin = 0,
                                             std::size_t end = std::numeric_limits<std::size_t>::max()) const;
  /// At most `count` of the entries with a pose in the frame of tracking, most similar first.
  [[nodiscard]] std::vector<Candidate> query_tracked(const Features& features, std::size_t count) const;
  [[nodiscard]] InvertedIndex::Bytes bytes() const;

 private:
  [[nodiscard]] std::vector<Candidate> most_similar(const Features& features, std::size_t count,
                                                    const std::function<bool(std::size_t)>& is_candidate) const;
  /// Indexes the features of the newest keyframes, if they are not indexed yet.
  [[nodiscard]] std::unique_lock<std::mutex> index_pending() const;
  void index_locked(const Features& features) const;

  std::vector<DatabaseEntry> entries_;
  mutable std::mutex mutex_;                     // guards the following
  mutable std::vector<FutureFeatures> pending_;  // of the newest entries, not indexed
  mutable std::vector<float> feature_norms_;     // square root of the number of features, by entry
  mutable InvertedIndex index_;
};

}  // namespace cairn
