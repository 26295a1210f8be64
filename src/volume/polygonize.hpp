// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <functional>
#include <span>
#include <vector>

#include "cairn/mesh.hpp"
#include "shaders/polygonize.h"
#include "volume/volume.hpp"

namespace cairn {

/// Marching cubes on the device. Vertices are shared between bricks: no cracks, no duplicates. The order of vertices
/// and triangles depends on the voxels alone.
class Polygonizer {
 public:
  explicit Polygonizer(gpu::Device& device);
  /// The surface of the whole map; bricks that are on the host are paged in, part by part.
  [[nodiscard]] Mesh polygonize(Volume& volume);
  /// The part of it in the cells of some bricks, sorted as Volume::bricks sorts them.
  [[nodiscard]] Mesh polygonize(Volume& volume, std::span<const Brick> bricks);
  /// The triangles of the cells of some bricks; what is not on the device counts as not there, and stays where it is.
  [[nodiscard]] Mesh on_device(Volume& volume, std::span<const Brick> bricks);

 private:
  struct Work;
  /// `resident`: all that the cells and their normals look at is on the device.
  [[nodiscard]] Mesh polygonize(Volume& volume, std::span<const Brick> wanted,
                                const std::function<bool(const Brick&)>& exists, bool resident);
  void add_vertices(const Volume& volume, Work& work, std::size_t begin, std::size_t end, Mesh& mesh);
  void add_triangles(const Volume& volume, Work& work, Mesh& mesh);

  gpu::Device& device_;
  gpu::Buffer table_;
  gpu::Kernel<shader::PolygonizePush> classify_, vertices_, triangles_;
};

/// The 256 cases, by the set of corners inside: triangle count, then the edges of the triangles, each an edge's lower
/// corner | axis << 3. On a face with two diagonal corners inside these are cut off one by one, in both cells that
/// share the face, so that surfaces of neighbouring cells meet.
[[nodiscard]] std::array<std::uint32_t, 256 * 16> marching_cubes_table();

}  // namespace cairn
