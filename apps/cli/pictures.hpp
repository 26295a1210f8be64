// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Planar images of a distance field.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/mesh.hpp"

namespace cairn::apps {

/// Writes the plane axis = `at` (meters; axis 0 to 2) with a legend as PNG.
void write_slice(const std::filesystem::path& png, const DistanceField& field, int axis, float at);

/// Height range in meters above the map's origin.
struct Band {
  float low = 0, high = 0;
};
/// Costmap for ROS map_server, of a map or of its cells. A pixel is occupied if a surface passes it within the band,
/// free if it is not occupied and at least half of the band is known, else unknown.
class Costmap {
 public:
  explicit Costmap(const Band& band) : band_(band) {}
  /// Adds a map or a cell. `field` and `surface` belong to the same map; `box` bounds its known voxels, see
  /// DistanceField::bounds(). For a cell, `box` bounds the cell's region, and `contains` is true for points in it;
  /// all cells have the same voxel size. Throws std::runtime_error if the known share of the box is too small to
  /// justify memory for the box.
  void add(const DistanceField& field, const Mesh& surface, const Eigen::AlignedBox3f& box,
           const std::function<bool(const Eigen::Vector3f&)>& contains = {});
  /// Writes the .yaml and a .pgm beside it. Throws std::runtime_error if the band contains no known voxel.
  void write(const std::filesystem::path& yaml) const;

 private:
  struct Pixel {
    std::uint16_t known = 0;  // number of known layers within the band
    bool is_occupied = false;
  };
  [[nodiscard]] Eigen::Vector3i voxel_at(const Eigen::Vector3f& point) const;
  [[nodiscard]] Pixel* find(int x, int z);  // null outside the box
  void grow(const Eigen::AlignedBox3i& box);

  Band band_;
  float voxel_size_ = 0;
  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();  // voxel (i, j, k) is at origin_ + voxel_size_ * (i, j, k)
  Eigen::AlignedBox3i box_;                           // bounds of the known region, voxels
  Eigen::AlignedBox3f all_;                           // the same bounds, meters
  std::size_t blocks_ = 0;                            // of the fields
  int first_ = 0, last_ = -1;                         // layers within the band
  std::vector<Pixel> pixels_;                         // of box_, x by x
};

}  // namespace cairn::apps
