// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/tiles_above.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <unsupported/Eigen/BVH>
#include <utility>

#include "export/cell_mesh.hpp"
#include "export/cells.hpp"
#include "geometry/mesh_vertices.hpp"
#include "mesh/colored_parts.hpp"
#include "mesh/gltf.hpp"
#include "mesh/simplify.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr float kMaxColoredSide = 0.1f;  // meters, of triangles colored at the vertices from a texture

/// Bisects the longest side of triangles until no side is longer. Both triangles of a side split it alike, so no gap
/// opens.
void subdivide(Mesh& mesh, float max_side) {
  std::vector<std::array<std::uint32_t, 3>> open = std::move(mesh.triangles);
  mesh.triangles.clear();
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
  const auto middle_of = [&](std::uint32_t a, std::uint32_t b) {
    const auto [it, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(mesh.positions.size()));
    if (is_new) {
      mesh.positions.emplace_back((mesh.positions[a] + mesh.positions[b]) / 2);
      if (!mesh.normals.empty()) mesh.normals.emplace_back((mesh.normals[a] + mesh.normals[b]).normalized());
      if (!mesh.texture_coordinates.empty())
        mesh.texture_coordinates.emplace_back((mesh.texture_coordinates[a] + mesh.texture_coordinates[b]) / 2);
    }
    return it->second;
  };
  while (!open.empty()) {
    auto t = open.back();
    open.pop_back();
    const auto length = [&](int k) { return (mesh.positions[t[(k + 1) % 3]] - mesh.positions[t[k]]).norm(); };
    int side = 0;
    for (int k = 1; k < 3; ++k)
      if (length(k) > length(side)) side = k;
    if (length(side) <= max_side) {
      mesh.triangles.push_back(t);
      continue;
    }
    std::rotate(t.begin(), t.begin() + side, t.end());
    const std::uint32_t m = middle_of(t[0], t[1]);
    open.push_back({t[0], m, t[2]});
    open.push_back({m, t[1], t[2]});
  }
}

/// Sets each vertex to the mean color of the nearest vertices of `fine`: a single vertex would alias a pattern.
void mix_colors(Mesh& mesh, const Mesh& fine) {
  struct Nearest {
    using Scalar = float;
    const Mesh& mesh;
    const Eigen::Vector3f& p;
    std::size_t vertex = 0;
    float min_squared = std::numeric_limits<float>::infinity();
    float minimumOnVolume(const Eigen::AlignedBox3f& box) const { return box.squaredExteriorDistance(p); }
    float minimumOnObject(int v) {
      const float squared = (mesh.positions[static_cast<std::size_t>(v)] - p).squaredNorm();
      if (squared < min_squared) min_squared = squared, vertex = static_cast<std::size_t>(v);
      return squared;
    }
  };
  std::vector<int> vertices(mesh.positions.size());
  std::iota(vertices.begin(), vertices.end(), 0);
  std::vector<Eigen::AlignedBox3f> boxes;
  boxes.reserve(vertices.size());
  for (const Eigen::Vector3f& p : mesh.positions) boxes.emplace_back(p);
  const Eigen::KdBVH<float, 3, int> tree(vertices.begin(), vertices.end(), boxes.begin(), boxes.end());
  std::vector<Eigen::Vector4f> sums(mesh.positions.size(), Eigen::Vector4f::Zero());
  for (std::size_t v = 0; v < fine.positions.size(); ++v) {
    Nearest nearest{mesh, fine.positions[v]};
    Eigen::BVMinimize(tree, nearest);
    const auto& c = fine.colors[v];
    sums[nearest.vertex] +=
        Eigen::Vector4f(static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2]), 1);
  }
  for (std::size_t v = 0; v < sums.size(); ++v)
    for (std::size_t k = 0; k < 3; ++k)
      mesh.colors[v][k] = static_cast<std::uint8_t>(std::lround(sums[v][static_cast<Eigen::Index>(k)] / sums[v][3]));
}

std::vector<bool> on_border(const Mesh& mesh) {
  std::vector<bool> border(mesh.positions.size(), false);
  for (const auto& [from, to] : boundary_edges(mesh, sides_by_edge(mesh, own_ids(mesh))))
    border[from] = border[to] = true;
  return border;
}

using GroupOf = std::function<Brick(const Brick& cell)>;

/// Cells by the position of their border vertices.
class SharedVertices {
 public:
  void add(const Mesh& mesh, const Brick& cell) {
    const std::vector<bool> border = on_border(mesh);
    for (std::size_t v = 0; v < border.size(); ++v)
      if (border[v]) cells_[key(mesh.positions[v])].push_back(cell);
  }
  /// Vertices shared with a cell outside of `group`; `group_of` maps a cell to its group.
  [[nodiscard]] std::vector<bool> with_others(const Mesh& mesh, const Brick& group, const GroupOf& group_of) const {
    std::vector<bool> shared(mesh.positions.size(), false);
    for (std::size_t v = 0; v < shared.size(); ++v)
      if (const auto found = cells_.find(key(mesh.positions[v])); found != cells_.end())
        shared[v] = std::any_of(found->second.begin(), found->second.end(),
                                [&](const Brick& cell) { return group_of(cell) != group; });
    return shared;
  }

 private:
  using Key = std::array<float, 3>;
  static Key key(const Eigen::Vector3f& p) { return {p.x(), p.y(), p.z()}; }
  std::map<Key, std::vector<Brick>> cells_;
};

/// Parent of some tiles; writes its mesh to `name`.glb.
CellTile parent_of(std::vector<CellTile> children, const Brick& group, const SharedVertices& vertices,
                   const GroupOf& group_of, const fs::path& folder, const std::string& name) {
  CellTile parent{.cell = group, .tile = {}, .mesh = folder / (name + ".glb")};
  std::vector<Mesh> parts;
  std::size_t triangles = 0;
  for (CellTile& child : children) {
    for (Mesh& part : read_mesh_parts(child.mesh)) {
      triangles += part.triangles.size();
      // A texture has colors between the vertices as well, such as a pattern on a flat floor.
      if (!part.texture.texels.empty()) subdivide(part, kMaxColoredSide);
      take_colors(part);
      parts.push_back(std::move(part));
    }
    parent.tile.box.extend(child.tile.box);
    parent.tile.error = std::max(parent.tile.error, child.tile.error);
    parent.tile.children.push_back(std::move(child.tile));
  }
  Mesh mesh = welded(parts);
  const std::vector<bool> locked = vertices.with_others(mesh, group, group_of);
  const float ratio = kLevelRatio * static_cast<float>(triangles) / static_cast<float>(mesh.triangles.size());
  const Mesh fine = mesh;
  parent.tile.error += static_cast<double>(simplify(mesh, {.ratio = std::min(1.0f, ratio)}, locked, true).error);
  if (!mesh.colors.empty()) mix_colors(mesh, fine);
  parent.tile.content = parent.mesh.filename().string();
  GltfWriter writer;
  writer.add(name, mesh);
  writer.write(parent.mesh);
  return parent;
}

/// Cells on both sides of zero never meet by halving: -1 and 0 stay -1 and 0.
bool are_around_zero(const std::vector<CellTile>& tiles) {
  return std::all_of(tiles.begin(), tiles.end(), [](const CellTile& tile) {
    return ((tile.cell.array() == 0) || (tile.cell.array() == -1)).all();
  });
}

}  // namespace

Tile tiles_above(std::vector<CellTile> tiles, const fs::path& folder) {
  SharedVertices vertices;
  for (const CellTile& tile : tiles) vertices.add(welded(read_mesh_parts(tile.mesh)), tile.cell);
  for (int level = 1; tiles.size() > 1; ++level) {
    const bool is_last = are_around_zero(tiles);
    const GroupOf group_of = [&](const Brick& cell) {
      return is_last ? Brick(Brick::Zero()) : Cells::at_level(cell, level);
    };
    std::map<Cells::Key, std::vector<CellTile>> groups;
    for (CellTile& tile : tiles)
      groups[Cells::key(is_last ? Brick(Brick::Zero()) : Cells::at_level(tile.cell, 1))].push_back(std::move(tile));
    tiles.clear();
    for (auto& [key, children] : groups) {
      const Brick group = Cells::brick(key);
      if (children.size() == 1) {
        children[0].cell = group;
        tiles.push_back(std::move(children[0]));
        continue;
      }
      const std::string name = fmt::format("above_{}_{}_{}_{}", level, key[0], key[1], key[2]);
      tiles.push_back(parent_of(std::move(children), group, vertices, group_of, folder, name));
    }
  }
  return std::move(tiles.front().tile);
}

}  // namespace cairn
