// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// From keyframes to the textures of parts.
#pragma once
#include "export/part.hpp"
#include "texture/views.hpp"

namespace cairn {

class Texturer {
 public:
  /// Compares the keyframes' colours. Throws std::runtime_error if there are none, or none with colour.
  explicit Texturer(ExportRun& run);
  /// A part's mesh with a texture, coarser from level to level of detail.
  [[nodiscard]] Mesh texture(Mesh mesh, const Part& part, int level);
  /// The volume holds another part of the map from now on.
  void forget() { views_.forget(); }

 private:
  /// Where to begin: as fine as the keyframes see and as it may fit.
  [[nodiscard]] float texel_size(const Mesh& mesh, int level) const;

  ExportRun& run_;
  TextureViews views_;
  std::size_t seen_ = 0;  // texels that a keyframe sees
};

}  // namespace cairn
