// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "geometry/mesh_vertices.hpp"

#include <type_traits>
#include <utility>

namespace cairn {
namespace {

template <class Work>
void for_each_attribute(Mesh& mesh, const Work& work) {
  const auto unless_empty = [&](auto& by_vertex) {
    if (!by_vertex.empty()) work(by_vertex);
  };
  unless_empty(mesh.positions);
  unless_empty(mesh.normals);
  unless_empty(mesh.colors);
  unless_empty(mesh.weights);
  unless_empty(mesh.sigmas);
  unless_empty(mesh.texture_coordinates);
}

}  // namespace

void take_vertices(Mesh& mesh, const std::vector<std::uint32_t>& vertices) {
  for_each_attribute(mesh, [&](auto& by_vertex) {
    std::remove_reference_t<decltype(by_vertex)> taken;
    taken.reserve(vertices.size());
    for (const std::uint32_t v : vertices) taken.push_back(by_vertex[v]);
    by_vertex = std::move(taken);
  });
}

std::vector<std::uint32_t> drop_unused_vertices(Mesh& mesh) {
  constexpr std::uint32_t kUnused = 0xffffffffu;
  std::vector<std::uint32_t> new_index(mesh.positions.size(), kUnused), used;
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t v : t) new_index[v] = 0;
  for (std::uint32_t v = 0; v < new_index.size(); ++v)
    if (new_index[v] != kUnused) {
      new_index[v] = static_cast<std::uint32_t>(used.size());
      used.push_back(v);
    }
  if (used.size() == new_index.size()) return used;
  // Ascending, so in place: a second array costs more than the copy.
  for_each_attribute(mesh, [&](auto& by_vertex) {
    for (std::size_t i = 0; i < used.size(); ++i) by_vertex[i] = by_vertex[used[i]];
    by_vertex.resize(used.size());
  });
  for (auto& t : mesh.triangles)
    for (std::uint32_t& v : t) v = new_index[v];
  return used;
}

void turn(Mesh& mesh, const Eigen::Quaterniond& by) {
  const Eigen::Matrix3d m = by.toRotationMatrix();
  if (m.isIdentity(0)) return;
  for (auto* vectors : {&mesh.positions, &mesh.normals})
    for (Eigen::Vector3f& v : *vectors) v = (m * v.cast<double>()).cast<float>();
}

Mesh turned(Mesh mesh, const Eigen::Quaterniond& by) {
  turn(mesh, by);
  return mesh;
}

}  // namespace cairn
