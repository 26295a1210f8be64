// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/change.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "export/check_range.hpp"
#include "export/export_run.hpp"
#include "mesh/clean.hpp"
#include "mesh/gltf.hpp"
#include "mesh/simplify.hpp"
#include "mesh/topology.hpp"
#include "volume/clear_space.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Maximum distance between two scans of an unchanged surface. Voxels in front of a surface are free from the truncation
// on (four voxels); a depth camera errs by two or three voxels at 4 m, and the alignment of merged maps by about 1.
constexpr float kUsualDistance = 4;     // voxels
constexpr int kMostDistance = 8;        // voxels, of known_space
constexpr double kLeastBoth = 0.1;      // minimum area observed by both maps, m2
constexpr double kMostOtherwise = 0.5;  // share of the commonly observed area: above it the maps have different frames,
                                        // not a change
constexpr float kFlat = 1;              // maximum error of simplification, voxels
constexpr std::array<float, 3> kGrey{225, 225, 225}, kNew{0, 114, 178}, kGone{230, 120, 0};  // after Okabe & Ito 2008

double area_of(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) {
  const Eigen::Vector3d a = mesh.positions[t[0]].cast<double>();
  return 0.5 * (mesh.positions[t[1]].cast<double>() - a).cross(mesh.positions[t[2]].cast<double>() - a).norm();
}

Eigen::Vector3d middle_of(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) {
  return (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]).cast<double>() / 3;
}

/// Surface of a map in some bricks, in its own frame, with the other map's knowledge of each vertex.
struct Compared {
  Mesh mesh;
  std::vector<bool> known, clear;
  [[nodiscard]] bool is_changed(const std::array<std::uint32_t, 3>& t) const {
    return clear[t[0]] && clear[t[1]] && clear[t[2]];
  }
  [[nodiscard]] bool is_known(const std::array<std::uint32_t, 3>& t) const {
    return known[t[0]] && known[t[1]] && known[t[2]];
  }
};

Compared compare(Mesh mesh, const MapParts& other, int reach) {
  Compared compared{.mesh = std::move(mesh), .known = {}, .clear = {}};
  const std::vector<Eigen::Vector3f>& positions = compared.mesh.positions;
  std::unordered_map<Brick, std::vector<std::uint32_t>, BrickHash> in_brick;
  const auto voxel_at = [&](std::uint32_t v) {
    return Eigen::Vector3i((positions[v] / other.voxel_size()).array().floor().cast<int>());
  };
  for (std::uint32_t v = 0; v < positions.size(); ++v)
    in_brick[voxel_at(v).unaryExpr([](int i) { return i >> 3; })].push_back(v);
  const std::vector<std::pair<Brick, std::vector<std::uint32_t>>> bricks(in_brick.begin(), in_brick.end());
  const BrickTree& tree = other.volume.on_host();
  std::vector<KnownSpace> spaces(bricks.size());
  tbb::parallel_for(std::size_t{0}, bricks.size(),
                    [&](std::size_t b) { spaces[b] = known_space(tree, other.free, bricks[b].first, reach); });
  compared.known.resize(positions.size());
  compared.clear.resize(positions.size());
  for (std::size_t b = 0; b < bricks.size(); ++b)
    for (const std::uint32_t v : bricks[b].second) {
      const Eigen::Vector3i at = voxel_at(v) - 8 * bricks[b].first;
      const auto word = static_cast<std::size_t>(at.x());
      const int bit = 8 * at.y() + at.z();
      compared.known[v] = (spaces[b].known[word] >> bit & 1) != 0;
      compared.clear[v] = (spaces[b].clear[word] >> bit & 1) != 0;
    }
  return compared;
}

/// Changed surface by brick; neighboring bricks form a single region.
class Pieces {
 public:
  Pieces(bool are_new, const MapParts& map)
      : are_new_(are_new),
        brick_size_(static_cast<double>(map.volume.brick_size())),
        world_from_map_(map.upright.world_from_tracked) {}

  void add(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) {
    const Eigen::Vector3d middle = middle_of(mesh, t);
    Part& part = parts_[brick_of(middle)];
    const double area = area_of(mesh, t);
    part.area += area;
    part.weighted += area * (world_from_map_ * middle);
    for (const std::uint32_t v : t) part.box.extend(world_from_map_ * mesh.positions[v].cast<double>());
  }
  /// Removes regions below a minimum area, and returns the rest.
  std::vector<ChangedPiece> settle(double min_area) {
    std::vector<ChangedPiece> pieces;
    std::unordered_set<Brick, BrickHash> done;
    for (const auto& [seed, of_seed] : parts_) {
      if (!done.insert(seed).second) continue;
      std::vector<Brick> piece{seed};
      Part all;
      for (std::size_t i = 0; i < piece.size(); ++i) {
        const Part& part = parts_.at(piece[i]);
        all.area += part.area, all.weighted += part.weighted, all.box.extend(part.box);
        for (int k = 0; k < 27; ++k)
          if (const Brick b = beside(piece[i], k); parts_.contains(b) && done.insert(b).second) piece.push_back(b);
      }
      if (all.area < min_area) continue;
      kept_.insert(piece.begin(), piece.end());
      pieces.push_back(
          {.is_new = are_new_, .area = all.area, .middle = all.weighted / all.area, .extent = all.box.sizes()});
    }
    return pieces;
  }
  /// True if a vertex of changed surface belongs to a kept region.
  [[nodiscard]] bool keeps(const Eigen::Vector3f& vertex) const {
    const Brick brick = brick_of(vertex.cast<double>());
    for (int k = 0; k < 27; ++k)
      if (kept_.contains(beside(brick, k))) return true;
    return false;
  }

 private:
  struct Part {
    double area = 0;                                     // m2
    Eigen::Vector3d weighted = Eigen::Vector3d::Zero();  // sum of positions weighted by area, in the world
    Eigen::AlignedBox3d box;
  };
  [[nodiscard]] Brick brick_of(const Eigen::Vector3d& p) const {
    return (p / brick_size_).array().floor().cast<int>().matrix();
  }
  static Brick beside(const Brick& b, int k) { return b + Brick(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1); }

  bool are_new_;
  double brick_size_;
  Eigen::Quaterniond world_from_map_;
  std::map<Brick, Part, decltype(&before)> parts_{&before};
  std::unordered_set<Brick, BrickHash> kept_;
};

/// Triangles that satisfy `which`, with only their vertices.
template <class Which>
Mesh taken(const Mesh& mesh, const Which& which) {
  Mesh part = mesh;
  part.weights.clear(), part.colours.clear();
  std::erase_if(part.triangles, [&](const auto& t) { return !which(t); });
  drop_unused_vertices(part);
  return part;
}

/// Simplifies a mesh; its boundary stays, since the next part continues there.
Mesh simpler(Mesh mesh, float max_error) {
  std::vector<bool> locked(mesh.positions.size(), false);
  for (const BoundaryEdge& edge : boundary_edges(mesh, sides_by_edge(mesh, own_ids(mesh))))
    locked[edge.from] = locked[edge.to] = true;
  (void)simplify(mesh, {.max_error = max_error}, locked, false);
  return mesh;
}

/// Sets one color, darker where the surface faces away from a lamp: viewers show vertex colors unlit.
void paint(Mesh& mesh, const std::array<float, 3>& colour) {
  const Eigen::Vector3f lamp = Eigen::Vector3f(0.3f, -0.8f, -0.5f).normalized();  // in the world, y down
  mesh.colours.resize(mesh.positions.size());
  for (std::size_t v = 0; v < mesh.colours.size(); ++v) {
    const float light = 0.8f + 0.2f * mesh.normals[v].dot(lamp);
    for (std::size_t c = 0; c < 3; ++c) mesh.colours[v][c] = static_cast<std::uint8_t>(std::lround(colour[c] * light));
    mesh.colours[v][3] = 255;
  }
}

/// Surface collected so far.
struct Gathered {
  std::vector<Mesh> same, are_new, gone;
  double both_of_before = 0, both_of_after = 0;  // m2 observed by the other map as well
};

void gather(const MapParts& before, const MapParts& after, const std::vector<Brick>& part, int reach, Gathered& to,
            Pieces& are_new, Pieces& gone) {
  const auto own = [&](const MapParts& map) {
    std::vector<Brick> bricks;
    std::set_intersection(part.begin(), part.end(), map.bricks.begin(), map.bricks.end(), std::back_inserter(bricks),
                          cairn::before);
    return bricks;
  };
  before.bring_around(part);
  after.bring_around(part);
  const float voxel = after.voxel_size();
  if (const std::vector<Brick> bricks = own(after); !bricks.empty()) {
    const Compared now = compare(after.polygonizer.polygonize(after.volume, bricks), before, reach);
    for (const auto& t : now.mesh.triangles) {
      if (now.is_known(t)) to.both_of_after += area_of(now.mesh, t);
      if (now.is_changed(t)) are_new.add(now.mesh, t);
    }
    to.same.push_back(simpler(taken(now.mesh, [&](const auto& t) { return !now.is_changed(t); }), kFlat * voxel));
    to.are_new.push_back(taken(now.mesh, [&](const auto& t) { return now.is_changed(t); }));
  }
  if (const std::vector<Brick> bricks = own(before); !bricks.empty()) {
    const Compared then = compare(before.polygonizer.polygonize(before.volume, bricks), after, reach);
    for (const auto& t : then.mesh.triangles) {
      if (then.is_known(t)) to.both_of_before += area_of(then.mesh, t);
      if (then.is_changed(t)) gone.add(then.mesh, t);
    }
    to.gone.push_back(taken(then.mesh, [&](const auto& t) { return then.is_changed(t); }));
  }
  malloc_trim(0);  // limits memory growth from part to part
}

double sum_of(const std::vector<ChangedPiece>& pieces, bool are_new) {
  double sum = 0;
  for (const ChangedPiece& piece : pieces) sum += piece.is_new == are_new ? piece.area : 0;
  return sum;
}

double area_of(const std::vector<Mesh>& meshes) {
  double sum = 0;
  for (const Mesh& mesh : meshes)
    for (const auto& t : mesh.triangles) sum += area_of(mesh, t);
  return sum;
}

void refuse_other_frame(const ChangeSide& before, const ChangeSide& after, const Gathered& gathered,
                        const fs::path& file) {
  const double both = gathered.both_of_before + gathered.both_of_after,
               otherwise = area_of(gathered.are_new) + area_of(gathered.gone);
  constexpr const char* kRemedy =
      "put both recordings into one plan (cairn plan, then cairn change PLAN --since ...), or go on with a copy of the "
      "first map";
  if (both < kLeastBoth)
    throw not_written(file, fmt::format("{} and {} have seen nothing in common where they lie: {}", before.name,
                                        after.name, kRemedy));
  if (otherwise > kMostOtherwise * both)
    throw not_written(file,
                      fmt::format("{} and {} are not in one frame: {:.0f} % of the surface that both could see is "
                                  "elsewhere in the other: {}",
                                  before.name, after.name, 100 * otherwise / both, kRemedy));
}

/// Writes the collected surface.
std::size_t write(Gathered& gathered, const Pieces& are_new, const Pieces& gone, const Upright& upright,
                  const fs::path& file) {
  const auto is_kept = [](const Mesh& mesh, const Pieces& pieces) {
    return [&](const std::array<std::uint32_t, 3>& t) {
      return pieces.keeps(mesh.positions[t[0]]) && pieces.keeps(mesh.positions[t[1]]) &&
             pieces.keeps(mesh.positions[t[2]]);
    };
  };
  const Mesh all_new = welded(gathered.are_new), all_gone = welded(gathered.gone);
  gathered.are_new.clear(), gathered.gone.clear();
  const auto stays = is_kept(all_new, are_new);
  gathered.same.push_back(taken(all_new, [&](const auto& t) { return !stays(t); }));
  Mesh same = welded(gathered.same);
  gathered.same.clear();
  (void)clean(same, {});
  GltfWriter gltf({.upright = upright, .file = file});
  std::size_t triangles = 0;
  const auto add = [&](const char* name, Mesh mesh, const std::array<float, 3>& colour) {
    turn(mesh, upright.world_from_tracked);
    paint(mesh, colour);
    triangles += gltf.add(name, mesh).triangles;
  };
  add("as before", std::move(same), kGrey);
  add("new", taken(all_new, stays), kNew);
  add("gone", taken(all_gone, is_kept(all_gone, gone)), kGone);
  (void)gltf.write(file);
  return triangles;
}

}  // namespace

void check(const ChangeOptions& options, const fs::path& file) {
  if (!is_gltf(file))
    throw std::runtime_error(fmt::format("{}: '{}' is no format that a change is written in; use .glb or .gltf",
                                         file.string(), file.extension().string()));
  check_range("ChangeOptions::distance", options.distance);
  check_range("ChangeOptions::min_area", options.min_area);
}

ExportedChange write_change(const ChangeSide& before, const ChangeSide& after, const fs::path& file,
                            const ChangeOptions& options, const ExportProgress& progress) {
  check(options, file);
  const float voxel = after.map.voxel_size();
  if (before.map.voxel_size() != voxel)
    throw not_written(file, fmt::format("{} has voxels of {} m, {} of {} m: make both with the same --voxel-size",
                                        before.name, before.map.voxel_size(), after.name, voxel));
  for (const ChangeSide* side : {&before, &after})
    if (side->map.bricks.empty()) throw not_written(file, side->name + " holds no surface");
  const float distance = options.distance > 0 ? options.distance : kUsualDistance * voxel;
  const int reach = static_cast<int>(std::lround(distance / voxel));
  if (reach < 1 || reach > kMostDistance)
    throw std::runtime_error(
        fmt::format("ChangeOptions::distance is {}: with voxels of {} m it must be between {} and "
                    "{}, or 0",
                    options.distance, voxel, voxel, kMostDistance * voxel));
  std::vector<Brick> bricks;
  std::set_union(before.map.bricks.begin(), before.map.bricks.end(), after.map.bricks.begin(), after.map.bricks.end(),
                 std::back_inserter(bricks), cairn::before);
  Pieces are_new(true, after.map), gone(false, after.map);
  Gathered gathered;
  const auto parts = in_parts(std::move(bricks));
  const int count = static_cast<int>(parts.size());
  for (int i = 0; i < count; ++i) {
    if (progress) progress(i, count + 1, "comparing");
    gather(before.map, after.map, parts[static_cast<std::size_t>(i)], reach, gathered, are_new, gone);
  }
  if (progress) progress(count, count + 1, "writing");
  refuse_other_frame(before, after, gathered, file);
  ExportedChange exported{.distance = static_cast<double>(static_cast<float>(reach) * voxel),
                          .new_area = 0,
                          .gone_area = 0,
                          .both_seen = gathered.both_of_after,
                          .pieces = are_new.settle(static_cast<double>(options.min_area)),
                          .triangles = 0};
  const std::vector<ChangedPiece> pieces = gone.settle(static_cast<double>(options.min_area));
  exported.pieces.insert(exported.pieces.end(), pieces.begin(), pieces.end());
  std::stable_sort(exported.pieces.begin(), exported.pieces.end(),
                   [](const ChangedPiece& a, const ChangedPiece& b) { return a.area > b.area; });
  exported.new_area = sum_of(exported.pieces, true), exported.gone_area = sum_of(exported.pieces, false);
  exported.triangles = write(gathered, are_new, gone, after.map.upright, file);
  if (progress) progress(count + 1, count + 1, "done");
  return exported;
}

}  // namespace cairn
