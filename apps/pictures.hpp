// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Plane pictures of a distance field.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "cairn/esdf.hpp"
#include "cairn/mesh.hpp"

namespace cairn::apps {

/// The plane axis = `at` (metres; axis 0 to 2) with a legend, as PNG.
void write_slice(const std::filesystem::path& png, const DistanceField& field, int axis, float at);

/// Metres above the map's origin.
struct Band {
  float low = 0, high = 0;
};
/// Occupancy as ROS map_server reads it, of a map or of parts of one. A pixel is occupied when a surface passes it in
/// the band, free when at least half of the band is known and nothing is in the way, else unknown.
class Costmap {
 public:
  explicit Costmap(const Band& band) : band_(band) {}
  /// `field` and `surface` are of the same map. `box`: around all that is known in it, DistanceField::bounds(). Of a
  /// part that of what is its own, and `is_own` tells of a point whether it is; all parts have voxels of one size.
  /// Throws std::runtime_error where so little of the box is known that memory for all of it would be wasted.
  void add(const DistanceField& field, const Mesh& surface, const Eigen::AlignedBox3f& box,
           const std::function<bool(const Eigen::Vector3f&)>& is_own = {});
  /// The .yaml and a .pgm beside it. Throws std::runtime_error where nothing is known in the band.
  void write(const std::filesystem::path& yaml) const;

 private:
  struct Pixel {
    std::uint16_t known = 0;  // of the band's layers
    bool is_occupied = false;
  };
  [[nodiscard]] Eigen::Vector3i voxel_at(const Eigen::Vector3f& point) const;
  [[nodiscard]] Pixel* find(int x, int z);  // null: beyond what is known
  void grow(const Eigen::AlignedBox3i& box);

  Band band_;
  float voxel_size_ = 0;
  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();  // voxel (i, j, k) is origin_ + voxel_size_ * (i, j, k)
  Eigen::AlignedBox3i box_;                           // of all that is known, voxels
  Eigen::AlignedBox3f all_;                           // the same, metres
  std::size_t blocks_ = 0;                            // of the fields
  int first_ = 0, last_ = -1;                         // layers that reach into the band
  std::vector<Pixel> pixels_;                         // of box_, x by x
};

}  // namespace cairn::apps
