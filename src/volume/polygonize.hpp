// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <functional>
#include <span>
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "shaders/polygonize.h"
#include "volume/volume.hpp"

namespace cairn {

/// Marching cubes on the device. Vertices are shared between bricks: no cracks, no duplicates. The order of vertices
/// and triangles depends on the voxels only.
class Polygonizer {
 public:
  explicit Polygonizer(gpu::Device& device);
  /// Surface of the complete map; pages in bricks from the host, region by region.
  [[nodiscard]] Mesh polygonize(Volume& volume);
  /// Surface in the cells of some bricks, sorted like Volume::bricks.
  [[nodiscard]] Mesh polygonize(Volume& volume, std::span<const Brick> bricks);
  /// Surface in the cells of some bricks. Bricks on the host count as missing and are not paged in.
  [[nodiscard]] Mesh on_device(Volume& volume, std::span<const Brick> bricks);

 private:
  struct Work;
  /// `resident`: all bricks needed for the cells and their normals are on the device.
  [[nodiscard]] Mesh polygonize(Volume& volume, std::span<const Brick> wanted,
                                const std::function<bool(const Brick&)>& exists, bool resident);
  void add_vertices(const Volume& volume, Work& work, std::size_t begin, std::size_t end, Mesh& mesh);
  void add_triangles(const Volume& volume, Work& work, Mesh& mesh);

  gpu::Device& device_;
  gpu::Buffer table_;
  gpu::Kernel<shader::PolygonizePush> classify_, vertices_, triangles_;
};

/// The 256 cases, by the set of corners inside: number of triangles, then the edges of the triangles, each as lower
/// corner of the edge | axis << 3. Two diagonal inside corners of a face are always separated, in both cells that share
/// the face, so the surfaces of adjacent cells match.
[[nodiscard]] std::array<std::uint32_t, 256 * 16> marching_cubes_table();

}  // namespace cairn
