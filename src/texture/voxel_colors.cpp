// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "texture/voxel_colors.hpp"

#include <cmath>

namespace cairn {

VoxelColors::VoxelColors(const Mesh& mesh, float size) : size_(size) {
  means_.reserve(mesh.colors.size() / 2);
  for (std::size_t v = 0; v < mesh.colors.size(); ++v) {
    Mean& mean = means_[(mesh.positions[v] / size).array().floor().matrix().cast<int>()];
    mean.sum += Eigen::Vector3f(mesh.colors[v][0], mesh.colors[v][1], mesh.colors[v][2]);
    ++mean.count;
  }
}

std::uint32_t VoxelColors::at(const Eigen::Vector3f& point, std::uint32_t otherwise) const {
  // Trilinear interpolation between the centers of the eight surrounding cubes.
  const Eigen::Vector3f p = point / size_ - Eigen::Vector3f::Constant(0.5f), low = p.array().floor().matrix(),
                        f = p - low;
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float total = 0;
  for (int c = 0; c < 8; ++c) {
    const Eigen::Vector3i corner(c & 1, c >> 1 & 1, c >> 2);
    const auto it = means_.find(low.cast<int>() + corner);
    if (it == means_.end()) continue;
    float weight = 0.02f;  // minimum, so that a single known cube counts even at its far side
    weight += (corner.x() != 0 ? f.x() : 1 - f.x()) * (corner.y() != 0 ? f.y() : 1 - f.y()) *
              (corner.z() != 0 ? f.z() : 1 - f.z());
    sum += weight / it->second.count * it->second.sum;
    total += weight;
  }
  if (!(total > 0)) return otherwise;
  const Eigen::Vector3f mean = sum / total;
  const auto byte = [](float value) { return static_cast<std::uint32_t>(std::lround(value)); };
  return byte(mean.x()) | byte(mean.y()) << 8 | byte(mean.z()) << 16;
}

}  // namespace cairn
