// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Textures of parts from keyframes.
#pragma once
#include "export/cell_mesh.hpp"
#include "texture/views.hpp"

namespace cairn {

class Texturer {
 public:
  /// Throws std::runtime_error without keyframes or without color.
  explicit Texturer(ExportRun& run);
  /// Mesh of a part with a texture, coarser for higher levels of detail.
  [[nodiscard]] Mesh texture(Mesh mesh, const CellMesh& part, int level);
  /// Call after the volume was loaded with another part of the map.
  void discard_images() { views_.discard_images(); }

 private:
  /// Initial texel sizes by vertex, meters: the keyframes' resolution, limited by the texture's size.
  [[nodiscard]] std::vector<float> texel_sizes(const Mesh& mesh, int level) const;

  ExportRun& run_;
  TextureViews views_;
  std::size_t visible_texels_ = 0;  // texels seen by a keyframe
};

}  // namespace cairn
