// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/clean.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <unordered_map>

#include "mesh/topology.hpp"

namespace cairn {
namespace {

constexpr int kSmoothingIterations = 3;       // iterations for borders
constexpr std::size_t kMaxRimVertices = 192;  // maximum number of vertices of a filled hole; the cost is cubic

Eigen::Vector3d area_vector(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) {
  const Eigen::Vector3d a = mesh.positions[t[0]].cast<double>();
  return 0.5 * (mesh.positions[t[1]].cast<double>() - a).cross(mesh.positions[t[2]].cast<double>() - a);
}

void remove_triangles(Mesh& mesh, const std::vector<bool>& remove) {
  std::erase_if(mesh.triangles, [&, i = std::size_t{0}](const auto&) mutable { return remove[i++]; });
}

void remove_unseen(Mesh& mesh, float min_weight) {
  if (min_weight <= 0 || mesh.weights.empty()) return;
  std::erase_if(mesh.triangles, [&](const auto& t) {
    return std::any_of(t.begin(), t.end(), [&](std::uint32_t v) { return mesh.weights[v] < min_weight; });
  });
}

bool lower_point(const Eigen::Vector3f& p, const Eigen::Vector3f& q) {
  return std::lexicographical_compare(p.data(), p.data() + 3, q.data(), q.data() + 3);
}

/// Order of triangles by positions, each from its lowest vertex on: independent of the vertex numbering.
bool lower_triangle(const Mesh& mesh, const std::array<std::uint32_t, 3>& a, const std::array<std::uint32_t, 3>& b) {
  const auto from_lowest = [&](const std::array<std::uint32_t, 3>& t) {
    std::array<Eigen::Vector3f, 3> p{mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]};
    std::rotate(p.begin(), std::min_element(p.begin(), p.end(), lower_point), p.end());
    return p;
  };
  const auto p = from_lowest(a), q = from_lowest(b);
  return std::lexicographical_compare(p.begin(), p.end(), q.begin(), q.end(), lower_point);
}

std::size_t remove_small_components(Mesh& mesh, const CleanOptions& options, const CountsTriangle& counts) {
  const Components components = connected_components(mesh, weld(mesh));
  struct Component {
    Eigen::AlignedBox3f box;
    double weight = 0, corners = 0;
    bool is_small = false;
    std::uint32_t lowest = kNone;  // lowest triangle, for small components
  };
  std::vector<Component> all(components.count);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    Component& component = all[components.of_triangle[i]];
    for (const std::uint32_t v : mesh.triangles[i]) {
      component.box.extend(mesh.positions[v]);
      component.weight += mesh.weights.empty() ? std::numeric_limits<float>::max() : mesh.weights[v];
      ++component.corners;
    }
  }
  for (Component& component : all) {
    const float size = component.box.diagonal().norm();
    const bool is_weak = component.weight < static_cast<double>(options.min_support) * component.corners;
    component.is_small = size < options.min_component || (size < 3 * options.min_component && is_weak);
  }
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    Component& component = all[components.of_triangle[i]];
    if (!component.is_small) continue;
    if (component.lowest == kNone || lower_triangle(mesh, mesh.triangles[i], mesh.triangles[component.lowest]))
      component.lowest = i;
  }
  const auto removed = std::count_if(all.begin(), all.end(), [&](const Component& component) {
    return component.is_small && (!counts || counts(mesh.triangles[component.lowest]));
  });
  std::erase_if(mesh.triangles,
                [&, i = std::size_t{0}](const auto&) mutable { return all[components.of_triangle[i++]].is_small; });
  return static_cast<std::size_t>(removed);
}

/// Removes triangles attached by a single side, which stick out of the border.
void remove_spikes(Mesh& mesh) {
  const std::vector<Side> sides = sides_by_edge(mesh, own_ids(mesh));
  std::vector<int> open(mesh.triangles.size(), 0);
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    if (end - begin == 1) ++open[sides[begin].triangle];
  });
  std::vector<bool> remove(open.size());
  for (std::size_t i = 0; i < open.size(); ++i) remove[i] = open[i] >= 2;
  remove_triangles(mesh, remove);
}

/// Smooths borders, which follow the voxel grid in steps. Moves each border vertex towards the mean of its two
/// neighbors along the border.
void smooth_borders(Mesh& mesh) {
  const std::vector<BoundaryEdge> border = boundary_edges(mesh, sides_by_edge(mesh, own_ids(mesh)));
  std::vector<std::uint32_t> next(mesh.positions.size(), kNone), previous = next;
  std::vector<bool> is_simple(mesh.positions.size(), true);
  for (const auto& [from, to] : border) {
    if (next[from] != kNone) is_simple[from] = false;
    if (previous[to] != kNone) is_simple[to] = false;
    next[from] = to, previous[to] = from;
  }
  std::vector<Eigen::Vector3f> smooth;
  for (int i = 0; i < kSmoothingIterations; ++i) {
    smooth = mesh.positions;
    for (const auto& [from, to] : border)
      if (is_simple[from] && previous[from] != kNone)
        smooth[from] =
            0.5f * mesh.positions[from] + 0.25f * (mesh.positions[previous[from]] + mesh.positions[next[from]]);
    mesh.positions.swap(smooth);
  }
}

/// Closes a rim by the triangulation with minimum area, by dynamic programming (Barequet & Sharir 1995). Adds nothing
/// if the result would have a degenerate triangle.
void fill(Mesh& mesh, const std::vector<std::uint32_t>& rim) {
  constexpr float kMinAreaRatio = 1e-3f, kForbidden = 1e6f;  // minimum area relative to the square of the longest side

  const std::size_t n = rim.size();
  std::vector<float> cost(n * n, 0);
  std::vector<std::uint32_t> split(n * n, 0);
  const auto area = [&](std::size_t i, std::size_t k, std::size_t j) {
    const Eigen::Vector3f &a = mesh.positions[rim[i]], b = mesh.positions[rim[k]], c = mesh.positions[rim[j]];
    const float triangle_area = 0.5f * (b - a).cross(c - a).norm();
    const float longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    return triangle_area > kMinAreaRatio * longest ? triangle_area : kForbidden;
  };
  for (std::size_t length = 2; length < n; ++length)
    for (std::size_t i = 0; i + length < n; ++i) {
      const std::size_t j = i + length;
      float best = std::numeric_limits<float>::max();
      for (std::size_t k = i + 1; k < j; ++k)
        if (const float c = cost[i * n + k] + cost[k * n + j] + area(i, k, j); c < best)
          best = c, split[i * n + j] = static_cast<std::uint32_t>(k);
      cost[i * n + j] = best;
    }
  if (cost[n - 1] >= kForbidden) return;
  std::vector<std::pair<std::size_t, std::size_t>> open{{0, n - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j < i + 2) continue;
    const std::size_t k = split[i * n + j];
    mesh.triangles.push_back({rim[j], rim[k], rim[i]});  // opposite to the direction of the border
    open.push_back({i, k});
    open.push_back({k, j});
  }
}

std::size_t fill_holes(Mesh& mesh, float max_size, const CountsTriangle& counts) {
  if (max_size <= 0) return 0;
  const std::vector<Side> sides = sides_by_edge(mesh, own_ids(mesh));
  std::unordered_map<std::uint32_t, std::uint32_t> next;
  std::vector<bool> is_branching(mesh.positions.size(), false);
  std::vector<std::uint32_t> begins;
  for (const auto& [from, to] : boundary_edges(mesh, sides)) {
    if (!next.try_emplace(from, to).second) is_branching[from] = true;
    begins.push_back(from);
  }
  // Starts at the lowest positions, to be independent of the vertex numbering.
  std::sort(begins.begin(), begins.end(),
            [&](std::uint32_t a, std::uint32_t b) { return lower_point(mesh.positions[a], mesh.positions[b]); });
  std::vector<std::uint64_t> edges;  // existing edges; a chord must not coincide with them
  for_each_edge(sides, [&](std::size_t begin, std::size_t) { edges.push_back(sides[begin].edge); });
  std::vector<bool> done(mesh.positions.size(), false);
  std::size_t filled = 0;
  for (const std::uint32_t begin : begins) {
    if (done[begin]) continue;
    std::vector<std::uint32_t> rim;
    Eigen::AlignedBox3f box;
    Eigen::Vector3d round = Eigen::Vector3d::Zero(), surface = Eigen::Vector3d::Zero();
    bool is_simple = true;
    for (std::uint32_t v = begin; !done[v]; v = next.at(v)) {
      done[v] = true;
      rim.push_back(v);
      box.extend(mesh.positions[v]);
      is_simple = is_simple && !is_branching[v] && next.contains(next.at(v));
      if (!is_simple) break;
    }
    if (!is_simple || rim.size() < 3 || rim.size() > kMaxRimVertices || box.diagonal().norm() > max_size) continue;
    // The border of a hole runs opposite to the surface's normal; the outer border of a component runs along with it.
    for (std::size_t i = 0; i < rim.size(); ++i) {
      const Eigen::Vector3d a = mesh.positions[rim[i]].cast<double>(),
                            b = mesh.positions[rim[(i + 1) % rim.size()]].cast<double>();
      round += (a - box.center().cast<double>()).cross(b - box.center().cast<double>());
      if (!mesh.normals.empty()) surface += mesh.normals[rim[i]].cast<double>();
    }
    if (!mesh.normals.empty() && round.dot(surface) > 0) continue;
    const std::size_t before = mesh.triangles.size();
    fill(mesh, rim);
    bool fits = mesh.triangles.size() > before;
    for (std::size_t t = before; t < mesh.triangles.size() && fits; ++t)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
        const auto it = next.find(b);
        if (it != next.end() && it->second == a) continue;  // edge of the rim
        const std::uint64_t edge = std::uint64_t{std::min(a, b)} << 32 | std::max(a, b);
        fits = fits && !std::binary_search(edges.begin(), edges.end(), edge);
      }
    if (!fits)
      mesh.triangles.resize(before);
    else
      filled += !counts || counts(mesh.triangles[before]);
  }
  return filled;
}

/// Handles triangles with the same three vertices: opposite triangles are a sheet without thickness and are both
/// removed; of triangles with equal orientation only one is kept. Returns true if there were any.
bool remove_coincident(Mesh& mesh, const std::vector<Side>& sides, const std::vector<std::uint32_t>& vertex_id,
                       bool keep_sheets) {
  std::vector<bool> remove(mesh.triangles.size(), false);
  bool any = false;
  const auto vertex = [&](const Side& s, std::uint32_t next) {
    return vertex_id[mesh.triangles[s.triangle][(s.corner + next) % 3]];
  };
  // Coincident triangles share all sides: at a given side they have the same third vertex.
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t k = begin; k < i; ++k) {
        if (vertex(sides[i], 2) != vertex(sides[k], 2)) continue;
        const bool are_opposite = vertex(sides[i], 0) != vertex(sides[k], 0);
        if (are_opposite && keep_sheets) continue;
        remove[sides[i].triangle] = any = true;
        if (are_opposite) remove[sides[k].triangle] = true;
      }
  });
  if (any) remove_triangles(mesh, remove);
  return any;
}

/// Removes the smallest triangles at sides shared by more than two. Returns true if there were any.
bool remove_beyond_two(Mesh& mesh, const std::vector<Side>& sides) {
  std::vector<bool> remove(mesh.triangles.size(), false);
  bool any = false;
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    std::size_t left = 0;
    for (std::size_t i = begin; i < end; ++i) left += !remove[sides[i].triangle];
    for (; left > 2; --left, any = true) {
      std::size_t smallest = end;
      for (std::size_t i = begin; i < end; ++i) {
        const std::uint32_t t = sides[i].triangle;
        if (remove[t]) continue;
        if (smallest == end || area_vector(mesh, mesh.triangles[t]).norm() <
                                   area_vector(mesh, mesh.triangles[sides[smallest].triangle]).norm())
          smallest = i;
      }
      remove[sides[smallest].triangle] = true;
    }
  });
  if (any) remove_triangles(mesh, remove);
  return any;
}

/// Removes all but the largest fan at each vertex; a fan is a set of triangles at a vertex connected by shared sides at
/// the vertex. `sides`: with one or two triangles each. `fixed`: as in make_manifold. Returns true if there were any.
bool remove_smaller_fans(Mesh& mesh, const std::vector<Side>& sides, const std::vector<std::uint32_t>& vertex_id,
                         const std::function<bool(std::uint32_t)>& fixed) {
  Fans fans = fans_of(mesh, sides, vertex_id);
  if (fixed) std::erase_if(fans.several, fixed);
  if (fans.several.empty()) return false;
  std::unordered_map<std::uint32_t, double> area;  // by fan
  for (std::uint32_t corner = 0; corner < fans.of_corner.size(); ++corner)
    if (fans.several.contains(vertex_id[mesh.triangles[corner / 3][corner % 3]]))
      area[fans.of_corner[corner]] += area_vector(mesh, mesh.triangles[corner / 3]).norm();
  // Equal areas: keeps the first fan.
  std::unordered_map<std::uint32_t, std::uint32_t> largest;  // by vertex
  for (std::uint32_t corner = 0; corner < fans.of_corner.size(); ++corner) {
    const std::uint32_t v = vertex_id[mesh.triangles[corner / 3][corner % 3]], fan = fans.of_corner[corner];
    if (!fans.several.contains(v)) continue;
    const auto [it, is_new] = largest.try_emplace(v, fan);
    if (!is_new && area.at(fan) > area.at(it->second)) it->second = fan;
  }
  std::vector<bool> remove(mesh.triangles.size(), false);
  for (std::uint32_t corner = 0; corner < fans.of_corner.size(); ++corner) {
    const auto it = largest.find(vertex_id[mesh.triangles[corner / 3][corner % 3]]);
    if (it != largest.end() && it->second != fans.of_corner[corner]) remove[corner / 3] = true;
  }
  remove_triangles(mesh, remove);
  return true;
}

}  // namespace

std::size_t make_manifold(Mesh& mesh, const ManifoldOptions& options) {
  const std::size_t before = mesh.triangles.size();
  const std::vector<std::uint32_t> vertex_id = weld(mesh);
  std::erase_if(mesh.triangles, [&](const auto& t) {
    return vertex_id[t[0]] == vertex_id[t[1]] || vertex_id[t[1]] == vertex_id[t[2]] ||
           vertex_id[t[2]] == vertex_id[t[0]] || !(area_vector(mesh, t).norm() > 0);
  });
  while (true) {
    const std::vector<Side> sides = sides_by_edge(mesh, vertex_id);
    if (!remove_coincident(mesh, sides, vertex_id, options.keep_sheets) && !remove_beyond_two(mesh, sides) &&
        !remove_smaller_fans(mesh, sides, vertex_id, options.fixed))
      break;
  }
  return before - mesh.triangles.size();
}

Cleaned clean(Mesh& mesh, const CleanOptions& options, const CountsTriangle& counts) {
  Cleaned cleaned;
  remove_unseen(mesh, options.min_weight);
  (void)make_manifold(mesh);
  cleaned.components_removed = remove_small_components(mesh, options, counts);
  remove_spikes(mesh);
  cleaned.holes_filled = fill_holes(mesh, options.fill_holes, counts);
  smooth_borders(mesh);
  (void)make_manifold(mesh);
  (void)drop_unused_vertices(mesh);
  return cleaned;
}

}  // namespace cairn
