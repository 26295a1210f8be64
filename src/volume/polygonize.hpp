// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <span>
#include <vector>

#include "cairn/mesh.hpp"
#include "shaders/polygonize.h"
#include "volume/volume.hpp"

namespace cairn {

/// Marching cubes on the device. Vertices are shared between bricks: no cracks, no duplicates. The order of vertices
/// and triangles depends on the voxels alone.
class Polygonize {
 public:
  explicit Polygonize(gpu::Device& device);
  /// The surface of the whole map; bricks that are on the host are paged in, part by part.
  [[nodiscard]] Mesh operator()(Volume& volume);
  /// The triangles of the cells of some bricks.
  [[nodiscard]] Mesh operator()(Volume& volume, std::span<const Brick> bricks);

 private:
  gpu::Device& device_;
  gpu::Buffer table_;
  gpu::Kernel<shader::PolygonizePush> classify_, vertices_, triangles_;
};

/// The 256 cases, by the set of corners inside: triangle count, then the edges of the triangles, each an edge's lower
/// corner | axis << 3. On a face with two diagonal corners inside these are cut off one by one, in both cells that
/// share the face, so that surfaces of neighbouring cells meet.
[[nodiscard]] std::array<std::uint32_t, 256 * 16> marching_cubes_table();

}  // namespace cairn
