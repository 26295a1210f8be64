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

/// A view of the map that can be recognised.
struct Place {
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  Features features;
  bool is_here = true;  // its pose is in the frame in which the camera is tracked now: not so for those of other pieces
};

/// Places, and an index of their corners that finds those alike without comparing with each: tables of places by some
/// bits of the descriptors (locality-sensitive hashing: Gionis, Indyk & Motwani 1999), where corners seen everywhere
/// say little (Sivic & Zisserman 2003). It grows with each place; no vocabulary is trained.
class Places {
 public:
  Places();
  void add(Place place);
  [[nodiscard]] std::size_t size() const { return places_.size(); }
  [[nodiscard]] const Place& operator[](std::size_t i) const { return places_[i]; }
  [[nodiscard]] Place& operator[](std::size_t i) { return places_[i]; }

  struct Alike {
    std::size_t place;
    float score;  // larger: more corners in common
  };
  /// At most `count` of the places from `begin` to `end`, the likest first.
  [[nodiscard]] std::vector<Alike> likest(const Features& features, std::size_t count, std::size_t begin = 0,
                                          std::size_t end = std::numeric_limits<std::size_t>::max()) const;

 private:
  static constexpr std::size_t kTables = 8, kBits = 16;
  static std::uint32_t key(std::size_t table, const std::array<std::uint8_t, 32>& descriptor);
  std::vector<Place> places_;
  std::vector<std::vector<std::uint32_t>> buckets_;  // places, by table and key
};

}  // namespace cairn
