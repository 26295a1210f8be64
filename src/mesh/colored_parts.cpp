// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/colored_parts.hpp"

#include <algorithm>
#include <cstddef>

namespace cairn {

void take_colors(Mesh& mesh) {
  const Texture& texture = mesh.texture;
  if (mesh.texture_coordinates.empty() || texture.texels.empty()) return;
  const auto texel = [](float share, int size) {
    return static_cast<std::size_t>(std::clamp(static_cast<int>(share * static_cast<float>(size)), 0, size - 1));
  };
  mesh.colors.clear();
  for (const Eigen::Vector2f& at : mesh.texture_coordinates) {
    const auto& rgb = texture.texels[texel(at.y(), texture.height) * static_cast<std::size_t>(texture.width) +
                                     texel(at.x(), texture.width)];
    mesh.colors.push_back({rgb[0], rgb[1], rgb[2], 255});
  }
  mesh.texture_coordinates.clear();
  mesh.texture = {};
}

std::vector<Mesh> colored_parts(const std::filesystem::path& file) {
  std::vector<Mesh> parts = read_mesh_parts(file);
  for (Mesh& part : parts) take_colors(part);
  return parts;
}

}  // namespace cairn
