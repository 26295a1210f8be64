// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/clean.hpp"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <optional>
#include <set>
#include <unordered_map>
#include <utility>

#include "mesh/topology.hpp"

namespace cairn {
namespace {

constexpr int kSmoothingIterations = 3;       // iterations for borders
constexpr std::size_t kMaxRimVertices = 192;  // maximum number of vertices of a filled hole; the cost is cubic

Eigen::Vector3d area_vector(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) {
  const Eigen::Vector3d a = mesh.positions[t[0]].cast<double>();
  return 0.5 * (mesh.positions[t[1]].cast<double>() - a).cross(mesh.positions[t[2]].cast<double>() - a);
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

std::size_t remove_small_components(Mesh& mesh, const std::vector<std::uint32_t>& vertex_id,
                                    const CleanOptions& options, const CountsTriangle& counts) {
  const Components components = connected_components(mesh, vertex_id);
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

/// Removes triangles attached by a single side, which stick out of the border. Returns true if there were any.
bool remove_spikes(Mesh& mesh, const std::vector<Side>& border) {
  std::vector<std::uint8_t> open(mesh.triangles.size(), 0);
  for (const Side& side : border) ++open[side.triangle];
  return std::erase_if(mesh.triangles, [&, i = std::size_t{0}](const auto&) mutable { return open[i++] >= 2; }) > 0;
}

/// Smooths borders, which follow the voxel grid in steps. Moves each border vertex towards the mean of its two
/// neighbors along the border.
void smooth_borders(Mesh& mesh, const std::vector<BoundaryEdge>& border) {
  std::vector<std::uint32_t> next(mesh.positions.size(), kNone), previous = next;
  std::vector<bool> is_simple(mesh.positions.size(), true);
  for (const auto& [from, to] : border) {
    if (next[from] != kNone) is_simple[from] = false;
    if (previous[to] != kNone) is_simple[to] = false;
    next[from] = to, previous[to] = from;
  }
  std::vector<Eigen::Vector3f> smooth(border.size());
  for (int i = 0; i < kSmoothingIterations; ++i) {
    for (std::size_t k = 0; k < border.size(); ++k) {
      const std::uint32_t from = border[k].from;
      smooth[k] = mesh.positions[from];
      if (is_simple[from] && previous[from] != kNone)
        smooth[k] = 0.5f * smooth[k] + 0.25f * (mesh.positions[previous[from]] + mesh.positions[next[from]]);
    }
    for (std::size_t k = 0; k < border.size(); ++k) mesh.positions[border[k].from] = smooth[k];
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

/// `corners`: of the mesh.
std::size_t fill_holes(Mesh& mesh, const std::vector<BoundaryEdge>& border, const CornersByVertex& corners,
                       float max_size, const CountsTriangle& counts) {
  if (max_size <= 0) return 0;
  const auto is_edge = [&](std::uint32_t a, std::uint32_t b) {
    return std::ranges::any_of(corners.at(a), [&](std::uint32_t corner) {
      return std::ranges::find(mesh.triangles[corner / 3], b) != mesh.triangles[corner / 3].end();
    });
  };
  std::unordered_map<std::uint32_t, std::uint32_t> next;
  std::vector<bool> is_branching(mesh.positions.size(), false);
  std::vector<std::uint32_t> begins;
  for (const auto& [from, to] : border) {
    if (!next.try_emplace(from, to).second) is_branching[from] = true;
    begins.push_back(from);
  }
  // Starts at the lowest positions, to be independent of the vertex numbering.
  std::sort(begins.begin(), begins.end(),
            [&](std::uint32_t a, std::uint32_t b) { return lower_point(mesh.positions[a], mesh.positions[b]); });
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
        fits = fits && !is_edge(a, b);                      // a chord must not coincide with an edge
      }
    if (!fits)
      mesh.triangles.resize(before);
    else
      filled += !counts || counts(mesh.triangles[before]);
  }
  return filled;
}

/// Makes a surface a manifold in passes: each removes triangles at the problems found by the one before.
class ManifoldMaker {
 public:
  /// `vertex_id`: of weld.
  ManifoldMaker(Mesh& mesh, const std::vector<std::uint32_t>& vertex_id, const ManifoldOptions& options)
      : mesh_(mesh), vertex_id_(vertex_id), options_(options), removed_(mesh.triangles.size(), false) {}

  void run() {
    std::vector<std::uint32_t> vertices = own_ids(mesh_);
    while (!vertices.empty()) {
      Problems problems = find_problems(vertices);
      if (options_.fixed) std::erase_if(problems.fans, options_.fixed);
      vertices = problems.fans;
      for (const Side& side : problems.sides) vertices.push_back(static_cast<std::uint32_t>(side.edge >> 32));
      const std::size_t before = vertices.size();
      if (!remove_coincident(problems.sides, vertices) && !remove_beyond_two(problems.sides, vertices))
        remove_smaller_fans(problems.fans, vertices);
      if (vertices.size() == before) break;
      std::sort(vertices.begin(), vertices.end());
      vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    }
    std::erase_if(mesh_.triangles, [&, i = std::size_t{0}](const auto&) mutable { return removed_[i++]; });
  }

 private:
  struct Problems {
    std::vector<Side> sides;          // of edges with coincident or more than two triangles
    std::vector<std::uint32_t> fans;  // vertices with several fans
  };

  /// Corners of the triangles left at a vertex.
  void left_at(std::uint32_t vertex, std::vector<std::uint32_t>& corners) const {
    corners.clear();
    for (const std::uint32_t corner : corners_.at(vertex))
      if (!removed_[corner / 3]) corners.push_back(corner);
  }
  Problems find_problems(const std::vector<std::uint32_t>& vertices) const {
    struct Found {
      Problems problems;
      std::vector<std::uint32_t> corners;
      std::vector<Side> sides;
    };
    tbb::enumerable_thread_specific<Found> by_thread;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, vertices.size()), [&](const auto& range) {
      Found& found = by_thread.local();
      for (std::size_t i = range.begin(); i < range.end(); ++i) {
        left_at(vertices[i], found.corners);
        sides_at(mesh_, vertex_id_, vertices[i], found.corners, found.sides);
        for_each_edge(found.sides, [&](std::size_t begin, std::size_t end) {
          if (end - begin > 2 || (end - begin == 2 && are_coincident(found.sides[begin], found.sides[begin + 1])))
            found.problems.sides.insert(found.problems.sides.end(), &found.sides[begin],
                                        &found.sides[begin] + (end - begin));
        });
        if (are_several_fans(mesh_, vertex_id_, found.corners)) found.problems.fans.push_back(vertices[i]);
      }
    });
    Problems all;
    for (const auto& [problems, corners, sides] : by_thread) {
      all.sides.insert(all.sides.end(), problems.sides.begin(), problems.sides.end());
      all.fans.insert(all.fans.end(), problems.fans.begin(), problems.fans.end());
    }
    std::sort(all.sides.begin(), all.sides.end());
    std::sort(all.fans.begin(), all.fans.end());
    return all;
  }
  [[nodiscard]] std::uint32_t vertex(const Side& s, std::uint32_t next) const {
    return vertex_id_[mesh_.triangles[s.triangle][(s.corner + next) % 3]];
  }
  /// Coincident triangles share all sides: at a given side they have the same third vertex.
  [[nodiscard]] bool are_coincident(const Side& a, const Side& b) const { return vertex(a, 2) == vertex(b, 2); }
  [[nodiscard]] double area(std::uint32_t triangle) const {
    return area_vector(mesh_, mesh_.triangles[triangle]).norm();
  }

  /// Marks a triangle as removed, and adds its vertices.
  void remove(std::uint32_t triangle, std::vector<std::uint32_t>& vertices) {
    removed_[triangle] = true;
    for (const std::uint32_t v : mesh_.triangles[triangle]) vertices.push_back(vertex_id_[v]);
  }

  /// Handles triangles with the same three vertices: opposite triangles are a sheet without thickness and are both
  /// removed; of triangles with equal orientation only one is kept. Returns true if there were any.
  bool remove_coincident(const std::vector<Side>& sides, std::vector<std::uint32_t>& vertices) {
    std::set<std::uint32_t> coincident;
    for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        for (std::size_t k = begin; k < i; ++k) {
          if (!are_coincident(sides[i], sides[k])) continue;
          const bool are_opposite = vertex(sides[i], 0) != vertex(sides[k], 0);
          if (are_opposite && options_.keep_sheets) continue;
          coincident.insert(sides[i].triangle);
          if (are_opposite) coincident.insert(sides[k].triangle);
        }
    });
    for (const std::uint32_t triangle : coincident) remove(triangle, vertices);
    return !coincident.empty();
  }

  /// Removes the smallest triangles at sides shared by more than two. Returns true if there were any.
  bool remove_beyond_two(const std::vector<Side>& sides, std::vector<std::uint32_t>& vertices) {
    bool any = false;
    for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
      std::size_t left = 0;
      for (std::size_t i = begin; i < end; ++i) left += !removed_[sides[i].triangle];
      for (; left > 2; --left, any = true) {
        std::size_t smallest = end;
        for (std::size_t i = begin; i < end; ++i) {
          const std::uint32_t t = sides[i].triangle;
          if (!removed_[t] && (smallest == end || area(t) < area(sides[smallest].triangle))) smallest = i;
        }
        remove(sides[smallest].triangle, vertices);
      }
    });
    return any;
  }

  /// Removes all but the largest fan at each of these vertices; a fan is a set of triangles at a vertex connected by
  /// shared sides at the vertex.
  void remove_smaller_fans(const std::vector<std::uint32_t>& several, std::vector<std::uint32_t>& vertices) {
    std::set<std::uint32_t> smaller;
    std::vector<std::uint32_t> corners;
    for (const std::uint32_t v : several) {
      left_at(v, corners);
      const std::vector<std::uint32_t> fans = fans_at(mesh_, vertex_id_, corners);
      std::vector<double> areas(corners.size(), 0);  // by fan
      for (std::size_t i = 0; i < corners.size(); ++i) areas[fans[i]] += area(corners[i] / 3);
      // Equal areas: keeps the first fan.
      const auto largest = static_cast<std::uint32_t>(std::ranges::max_element(areas) - areas.begin());
      for (std::size_t i = 0; i < corners.size(); ++i)
        if (fans[i] != largest) smaller.insert(corners[i] / 3);
    }
    for (const std::uint32_t triangle : smaller) remove(triangle, vertices);
  }

  Mesh& mesh_;
  const std::vector<std::uint32_t>& vertex_id_;
  const ManifoldOptions& options_;
  const CornersByVertex corners_{mesh_, vertex_id_};
  std::vector<bool> removed_;  // by triangle
};

/// `vertex_id`: of weld.
std::size_t make_manifold(Mesh& mesh, const std::vector<std::uint32_t>& vertex_id, const ManifoldOptions& options) {
  const std::size_t before = mesh.triangles.size();
  std::erase_if(mesh.triangles, [&](const auto& t) {
    return vertex_id[t[0]] == vertex_id[t[1]] || vertex_id[t[1]] == vertex_id[t[2]] ||
           vertex_id[t[2]] == vertex_id[t[0]] || !(area_vector(mesh, t).norm() > 0);
  });
  ManifoldMaker(mesh, vertex_id, options).run();
  return before - mesh.triangles.size();
}

}  // namespace

std::size_t make_manifold(Mesh& mesh, const ManifoldOptions& options) {
  return make_manifold(mesh, weld(mesh), options);
}

Cleaned clean(Mesh& mesh, const CleanOptions& options, const CountsTriangle& counts) {
  Cleaned cleaned;
  remove_unseen(mesh, options.min_weight);
  {
    const std::vector<std::uint32_t> vertex_id = weld(mesh);
    (void)make_manifold(mesh, vertex_id, {});
    cleaned.components_removed = remove_small_components(mesh, vertex_id, options, counts);
  }
  {
    const std::vector<std::uint32_t> vertex_id = own_ids(mesh);
    std::optional<CornersByVertex> corners(std::in_place, mesh, vertex_id);
    std::vector<Side> border = border_sides(mesh, vertex_id, *corners);
    if (remove_spikes(mesh, border)) {
      corners.emplace(mesh, vertex_id);
      border = border_sides(mesh, vertex_id, *corners);
    }
    const std::size_t before = mesh.triangles.size();
    cleaned.holes_filled = fill_holes(mesh, boundary_edges(mesh, border), *corners, options.fill_holes, counts);
    for (std::size_t t = before; t < mesh.triangles.size(); ++t)
      for (std::uint32_t c = 0; c < 3; ++c)
        border.push_back(side_of(mesh, vertex_id, static_cast<std::uint32_t>(t), c));
    std::sort(border.begin(), border.end());
    smooth_borders(mesh, boundary_edges(mesh, border));
  }
  (void)make_manifold(mesh);
  (void)drop_unused_vertices(mesh);
  return cleaned;
}

}  // namespace cairn
