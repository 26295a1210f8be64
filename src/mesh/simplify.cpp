// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/simplify.hpp"

#include <meshoptimizer.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "mesh/clean.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

constexpr int kMaxRounds = 4;        // attempts to repeat a collapse with non-manifold results
constexpr float kErrorRatio = 2.5f;  // maximum distance between surfaces in units of the quadric error: on spheres 2.4
constexpr float kRegionScale = 24;   // Felzenszwalb & Huttenlocher's k, in color steps
constexpr std::uint32_t kMinRegionSize = 64;  // triangles; smaller regions are noise
constexpr float kUnlimitedError = 1;          // relative to the mesh size
constexpr int kVotingRounds = 2;              // voting rounds to straighten the borders of regions

/// Input of meshoptimizer: a vertex per region that meets in it, which turns the edges between regions into seams.
struct Split {
  std::vector<Eigen::Vector3f> positions;
  std::vector<std::uint32_t> original, indices;
};

Split split_by_region(const Mesh& mesh, const std::vector<std::uint32_t>& region) {
  Split split;
  split.positions = mesh.positions;
  split.original.resize(mesh.positions.size());
  std::iota(split.original.begin(), split.original.end(), 0u);
  std::vector<std::uint32_t> region_of(mesh.positions.size(), kNone);
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> more;  // keys: vertex and region
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (std::uint32_t v : mesh.triangles[i]) {
      const std::uint32_t r = region.empty() ? 0 : region[i];
      if (region_of[v] == kNone) region_of[v] = r;
      if (region_of[v] != r) {
        const auto [it, is_new] = more.try_emplace({v, r}, static_cast<std::uint32_t>(split.positions.size()));
        if (is_new) {
          split.positions.push_back(mesh.positions[v]);
          split.original.push_back(v);
        }
        v = it->second;
      }
      split.indices.push_back(v);
    }
  return split;
}

/// Locks vertices: meshoptimizer does not move a position shared by three or more vertices, so unused copies are added.
void lock_vertices(Split& split, const Mesh& mesh, const std::vector<bool>& locked) {
  for (std::uint32_t v = 0; v < locked.size(); ++v)
    if (locked[v])
      for (int i = 0; i < 2; ++i) {
        split.positions.push_back(mesh.positions[v]);
        split.original.push_back(v);
      }
}

/// Predicate for make_manifold: vertices shared with other meshes.
auto is_in(const std::vector<bool>& locked) {
  return [&locked](std::uint32_t v) { return v < locked.size() && locked[v]; };
}

using Corners = std::array<std::uint32_t, 3>;

/// Triangles with three locked vertices, each from its lowest vertex on.
std::set<Corners> between_locked(const std::vector<Corners>& triangles, const std::vector<bool>& locked) {
  std::set<Corners> all;
  for (Corners t : triangles)
    if (std::all_of(t.begin(), t.end(), is_in(locked))) {
      std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
      all.insert(t);
    }
  return all;
}

/// Vertices of edges with more than two triangles, vertices with several fans of triangles, and vertices of triangles
/// between locked vertices that are not in `before`: another mesh may create the same triangle.
std::vector<std::uint32_t> non_manifold_vertices(const Mesh& mesh, const std::vector<bool>& locked,
                                                 const std::set<Corners>& before) {
  const std::vector<std::uint32_t> vertex_id = weld(mesh);
  const std::vector<Side> sides = sides_by_edge(mesh, vertex_id);
  std::vector<std::uint32_t> non_manifold;
  for (const std::uint32_t v : vertices_with_several_fans(mesh, vertex_id))
    if (!is_in(locked)(v)) non_manifold.push_back(v);
  for (const Corners& t : between_locked(mesh.triangles, locked))
    if (!before.contains(t)) non_manifold.insert(non_manifold.end(), t.begin(), t.end());
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    if (end - begin <= 2) return;
    non_manifold.push_back(static_cast<std::uint32_t>(sides[begin].edge >> 32));
    non_manifold.push_back(static_cast<std::uint32_t>(sides[begin].edge));
  });
  return non_manifold;
}

/// Two triangles with a common side.
struct Link {
  float difference;  // color difference
  std::uint32_t a, b;
};

/// Sorted by difference.
std::vector<Link> links_between(const Mesh& mesh) {
  std::vector<Eigen::Vector3f> color;  // by triangle
  for (const auto& t : mesh.triangles) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (const std::uint32_t v : t) sum += Eigen::Vector3f(mesh.colors[v][0], mesh.colors[v][1], mesh.colors[v][2]) / 3;
    color.push_back(sum);
  }
  std::vector<Link> links;
  const std::vector<Side> sides = sides_by_edge(mesh, weld(mesh));
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin + 1; i < end; ++i) {
      const std::uint32_t a = sides[begin].triangle, b = sides[i].triangle;
      links.push_back({(color[a] - color[b]).norm(), a, b});
    }
  });
  tbb::parallel_sort(links, [](const Link& x, const Link& y) {
    return std::tie(x.difference, x.a, x.b) < std::tie(y.difference, y.a, y.b);
  });
  return links;
}

/// Graph-based segmentation: merges regions if their difference does not exceed their internal differences
/// (Felzenszwalb & Huttenlocher 2004), then merges small regions with their most similar neighbor.
std::vector<std::uint32_t> segment(std::size_t triangles, const std::vector<Link>& links) {
  std::vector<std::uint32_t> parent(triangles), size(triangles, 1);
  std::iota(parent.begin(), parent.end(), 0u);
  std::vector<float> inside(triangles, 0);
  const auto root = [&](std::uint32_t t) {
    while (parent[t] != t) t = parent[t] = parent[parent[t]];
    return t;
  };
  const auto join = [&](std::uint32_t a, std::uint32_t b) {
    if (size[a] < size[b]) std::swap(a, b);
    parent[b] = a;
    size[a] += size[b];
    return a;
  };
  for (const auto& [difference, a, b] : links) {
    const std::uint32_t p = root(a), q = root(b);
    const auto limit = [&](std::uint32_t r) {
      return inside[r] + kRegionScale / std::sqrt(static_cast<float>(size[r]));
    };
    if (p != q && difference <= std::min(limit(p), limit(q))) inside[join(p, q)] = difference;
  }
  for (const Link& link : links) {
    const std::uint32_t p = root(link.a), q = root(link.b);
    if (p != q && std::min(size[p], size[q]) < kMinRegionSize) (void)join(p, q);
  }
  std::vector<std::uint32_t> region(triangles);
  for (std::uint32_t t = 0; t < region.size(); ++t) region[t] = root(t);
  return region;
}

/// Assigns each triangle to the region of a majority of its neighbors, which straightens the borders of regions.
void straighten(std::vector<std::uint32_t>& region, const std::vector<Link>& links) {
  std::vector<std::array<std::uint32_t, 3>> neighbors(region.size(), {kNone, kNone, kNone});
  for (const Link& link : links)
    for (const auto& [t, other] : {std::pair(link.a, link.b), {link.b, link.a}})
      if (const auto slot = std::find(neighbors[t].begin(), neighbors[t].end(), kNone); slot != neighbors[t].end())
        *slot = other;
  for (int vote = 0; vote < kVotingRounds; ++vote) {
    const std::vector<std::uint32_t> was = region;
    for (std::size_t t = 0; t < region.size(); ++t) {
      const auto& [a, b, c] = neighbors[t];
      const auto agree = [&](std::uint32_t i, std::uint32_t j) { return i != kNone && j != kNone && was[i] == was[j]; };
      if (agree(a, b) || agree(a, c))
        region[t] = was[a];
      else if (agree(b, c))
        region[t] = was[b];
    }
  }
}

float scale_of(const Mesh& mesh) {
  return meshopt_simplifyScale(mesh.positions[0].data(), mesh.positions.size(), sizeof(Eigen::Vector3f));
}

/// Collapses edges down to `target` triangles, as long as the surface moves by at most `allowed` of its size.
/// `manifold_options`: options for the final make_manifold.
Simplified collapse(Mesh& mesh, std::size_t target, float allowed, const std::vector<bool>& locked, bool keep_colors,
                    const ManifoldOptions& manifold_options) {
  const float scale = scale_of(mesh);
  const std::vector<std::uint32_t> region =
      keep_colors && !mesh.colors.empty() ? color_regions(mesh) : std::vector<std::uint32_t>{};
  const std::set<Corners> before = between_locked(mesh.triangles, locked);
  std::vector<bool> fixed = locked;
  float error = 0;
  for (int round = 0;; ++round) {
    Split split = split_by_region(mesh, region);
    lock_vertices(split, mesh, fixed);
    std::vector<std::uint32_t> remaining(split.indices.size());
    remaining.resize(meshopt_simplify(remaining.data(), split.indices.data(), split.indices.size(),
                                      split.positions[0].data(), split.positions.size(), sizeof(Eigen::Vector3f),
                                      3 * target, allowed, 0, &error));
    Mesh simple;
    simple.positions = mesh.positions;
    for (std::size_t i = 0; i < remaining.size(); i += 3)
      simple.triangles.push_back(
          {split.original[remaining[i]], split.original[remaining[i + 1]], split.original[remaining[i + 2]]});
    const std::vector<std::uint32_t> non_manifold = non_manifold_vertices(simple, locked, before);
    if (non_manifold.empty() || round == kMaxRounds) {
      mesh.triangles = std::move(simple.triangles);
      (void)make_manifold(mesh, manifold_options);
      break;
    }
    // Keeps the original surface there: locks the neighborhood of these vertices.
    std::vector<bool> near(mesh.positions.size(), false);
    for (const std::uint32_t v : non_manifold) near[v] = true;
    for (int ring = 0; ring <= round; ++ring) {
      std::vector<bool> wider = near;
      for (const auto& t : mesh.triangles)
        if (near[t[0]] || near[t[1]] || near[t[2]])
          for (const std::uint32_t v : t) wider[v] = true;
      near.swap(wider);
    }
    fixed.resize(mesh.positions.size(), false);
    for (std::size_t v = 0; v < near.size(); ++v)
      if (near[v]) fixed[v] = true;
  }
  return {kErrorRatio * error * scale, drop_unused_vertices(mesh)};
}

/// Reduces to `target` triangles regardless of the shape: merges the vertices of each cell of a coarse grid.
Simplified cluster(Mesh& mesh, std::size_t target) {
  std::vector<std::uint32_t> all;
  for (const auto& t : mesh.triangles) all.insert(all.end(), t.begin(), t.end());
  std::vector<std::uint32_t> remaining(all.size());
  float error = 0;
  remaining.resize(meshopt_simplifySloppy(remaining.data(), all.data(), all.size(), mesh.positions[0].data(),
                                          mesh.positions.size(), sizeof(Eigen::Vector3f), 3 * target, kUnlimitedError,
                                          &error));
  const float scale = scale_of(mesh);
  mesh.triangles.clear();
  for (std::size_t i = 0; i + 2 < remaining.size(); i += 3)
    mesh.triangles.push_back({remaining[i], remaining[i + 1], remaining[i + 2]});
  (void)make_manifold(mesh);
  return {error * scale, drop_unused_vertices(mesh)};
}

/// Reduces to at most `max_triangles` triangles. Drops constraints in this order: color edges, locked vertices, and
/// finally the shape itself. Components that collapse to two opposite triangles are kept if almost nothing would be
/// left without them.
Simplified collapse_to(Mesh& mesh, std::size_t max_triangles, const std::vector<bool>& locked, bool keep_colors) {
  const bool has_colors = keep_colors && !mesh.colors.empty(),
             has_locked = std::find(locked.begin(), locked.end(), true) != locked.end();
  const std::vector<bool> none;
  struct Constraints {
    bool keeps_colors, keeps_locked, keeps_sheets;
  };
  for (const Constraints& t :
       {Constraints{true, true, false}, {false, true, false}, {false, false, false}, {false, false, true}}) {
    if ((!t.keeps_colors && t.keeps_locked && !has_colors) || (!t.keeps_locked && !t.keeps_sheets && !has_locked))
      continue;
    const std::vector<bool>& kept = t.keeps_locked ? locked : none;
    ManifoldOptions manifold_options{.fixed = is_in(kept), .keep_sheets = t.keeps_sheets};
    if (t.keeps_sheets) manifold_options.fixed = [](std::uint32_t) { return true; };
    Mesh fewer = mesh;
    Simplified simplified =
        collapse(fewer, max_triangles, kUnlimitedError, kept, t.keeps_colors && has_colors, manifold_options);
    if (fewer.triangles.size() > max_triangles || 2 * fewer.triangles.size() < max_triangles) continue;
    mesh = std::move(fewer);
    return simplified;
  }
  return cluster(mesh, max_triangles);
}

}  // namespace

Simplified simplify(Mesh& mesh, const SimplifyOptions& options, const std::vector<bool>& locked, bool keep_colors) {
  if (options.triangles > 0 && mesh.triangles.size() > options.triangles)
    return collapse_to(mesh, options.triangles, locked, keep_colors);
  if (mesh.triangles.empty() || options.triangles > 0 || (options.ratio >= 1 && options.max_error <= 0))
    return {0, drop_unused_vertices(mesh)};
  const auto target =
      options.max_error > 0 && options.ratio >= 1
          ? std::size_t{0}
          : static_cast<std::size_t>(static_cast<double>(options.ratio) * static_cast<double>(mesh.triangles.size()));
  const float allowed = options.max_error > 0 ? options.max_error / (kErrorRatio * scale_of(mesh)) : kUnlimitedError;
  return collapse(mesh, target, allowed, locked, keep_colors, {.fixed = is_in(locked)});
}

std::vector<std::uint32_t> color_regions(const Mesh& mesh) {
  const std::vector<Link> links = links_between(mesh);
  std::vector<std::uint32_t> region = segment(mesh.triangles.size(), links);
  straighten(region, links);
  return region;
}

}  // namespace cairn
