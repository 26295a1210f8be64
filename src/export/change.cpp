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
#include "volume/observed_space.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Maximum distance between two scans of an unchanged surface. Voxels in front of a surface are free from the truncation
// on (four voxels); a depth camera errs by two or three voxels at 4 m, and the alignment of merged maps by about 1.
constexpr float kDefaultDistance = 4;     // voxels
constexpr int kMaxDistance = 8;           // voxels, of observed_space
constexpr double kMinCommonArea = 0.1;    // minimum area observed by both maps, m2
constexpr double kMaxChangedRatio = 0.5;  // share of the commonly observed area: above it the maps have different
                                          // frames, not a change
constexpr float kMaxSimplifyError = 1;    // maximum error of simplification, voxels
constexpr std::array<float, 3> kGray{225, 225, 225}, kNew{0, 114, 178}, kGone{230, 120, 0};  // after Okabe & Ito 2008

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
  std::vector<bool> observed, free;
  [[nodiscard]] bool is_changed(const std::array<std::uint32_t, 3>& t) const {
    return free[t[0]] && free[t[1]] && free[t[2]];
  }
  [[nodiscard]] bool is_observed(const std::array<std::uint32_t, 3>& t) const {
    return observed[t[0]] && observed[t[1]] && observed[t[2]];
  }
};

Compared compare(Mesh mesh, const MapChunks& other, int reach) {
  Compared compared{.mesh = std::move(mesh), .observed = {}, .free = {}};
  const std::vector<Eigen::Vector3f>& positions = compared.mesh.positions;
  std::unordered_map<Brick, std::vector<std::uint32_t>, BrickHash> in_brick;
  const auto voxel_at = [&](std::uint32_t v) {
    return Eigen::Vector3i((positions[v] / other.voxel_size()).array().floor().cast<int>());
  };
  for (std::uint32_t v = 0; v < positions.size(); ++v)
    in_brick[voxel_at(v).unaryExpr([](int i) { return i >> 3; })].push_back(v);
  const std::vector<std::pair<Brick, std::vector<std::uint32_t>>> bricks(in_brick.begin(), in_brick.end());
  const BrickTree& tree = other.volume.on_host();
  std::vector<ObservedSpace> spaces(bricks.size());
  tbb::parallel_for(std::size_t{0}, bricks.size(),
                    [&](std::size_t b) { spaces[b] = observed_space(tree, other.free, bricks[b].first, reach); });
  compared.observed.resize(positions.size());
  compared.free.resize(positions.size());
  for (std::size_t b = 0; b < bricks.size(); ++b)
    for (const std::uint32_t v : bricks[b].second) {
      const Eigen::Vector3i at = voxel_at(v) - 8 * bricks[b].first;
      const auto word = static_cast<std::size_t>(at.x());
      const int bit = 8 * at.y() + at.z();
      compared.observed[v] = (spaces[b].observed[word] >> bit & 1) != 0;
      compared.free[v] = (spaces[b].clear[word] >> bit & 1) != 0;
    }
  return compared;
}

/// Changed surface by brick; neighboring bricks form a single region.
class ChangedRegions {
 public:
  ChangedRegions(bool added, const MapChunks& map)
      : are_added_(added),
        brick_size_(static_cast<double>(map.volume.brick_size())),
        world_from_map_(map.upright.world_from_tracked) {}

  void add(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) {
    const Eigen::Vector3d middle = middle_of(mesh, t);
    BrickArea& part = parts_[brick_of(middle)];
    const double area = area_of(mesh, t);
    part.area += area;
    part.weighted += area * (world_from_map_ * middle);
    for (const std::uint32_t v : t) part.box.extend(world_from_map_ * mesh.positions[v].cast<double>());
  }
  /// Removes regions below a minimum area, and returns the rest.
  std::vector<ChangedRegion> extract(double min_area) {
    std::vector<ChangedRegion> regions;
    std::unordered_set<Brick, BrickHash> done;
    for (const auto& [seed, of_seed] : parts_) {
      if (!done.insert(seed).second) continue;
      std::vector<Brick> region{seed};
      BrickArea all;
      for (std::size_t i = 0; i < region.size(); ++i) {
        const BrickArea& part = parts_.at(region[i]);
        all.area += part.area, all.weighted += part.weighted, all.box.extend(part.box);
        for (int k = 0; k < 27; ++k)
          if (const Brick b = neighbor(region[i], k); parts_.contains(b) && done.insert(b).second) region.push_back(b);
      }
      if (all.area < min_area) continue;
      kept_.insert(region.begin(), region.end());
      regions.push_back(
          {.is_new = are_added_, .area = all.area, .middle = all.weighted / all.area, .extent = all.box.sizes()});
    }
    return regions;
  }
  /// True if a vertex of changed surface belongs to a kept region.
  [[nodiscard]] bool contains(const Eigen::Vector3f& vertex) const {
    const Brick brick = brick_of(vertex.cast<double>());
    for (int k = 0; k < 27; ++k)
      if (kept_.contains(neighbor(brick, k))) return true;
    return false;
  }

 private:
  struct BrickArea {
    double area = 0;                                     // m2
    Eigen::Vector3d weighted = Eigen::Vector3d::Zero();  // sum of positions weighted by area, in the world
    Eigen::AlignedBox3d box;
  };
  [[nodiscard]] Brick brick_of(const Eigen::Vector3d& p) const {
    return (p / brick_size_).array().floor().cast<int>().matrix();
  }
  static Brick neighbor(const Brick& b, int k) { return b + Brick(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1); }

  bool are_added_;
  double brick_size_;
  Eigen::Quaterniond world_from_map_;
  std::map<Brick, BrickArea, decltype(&before)> parts_{&before};
  std::unordered_set<Brick, BrickHash> kept_;
};

/// Triangles that satisfy `which`, with only their vertices.
template <class Which>
Mesh extracted(const Mesh& mesh, const Which& which) {
  Mesh part = mesh;
  part.weights.clear(), part.colors.clear();
  std::erase_if(part.triangles, [&](const auto& t) { return !which(t); });
  drop_unused_vertices(part);
  return part;
}

/// Simplifies a mesh; its boundary stays, since the next part continues there.
Mesh simplified(Mesh mesh, float max_error) {
  std::vector<bool> locked(mesh.positions.size(), false);
  for (const BoundaryEdge& edge : boundary_edges(mesh, sides_by_edge(mesh, own_ids(mesh))))
    locked[edge.from] = locked[edge.to] = true;
  (void)simplify(mesh, {.max_error = max_error}, locked, false);
  return mesh;
}

/// Sets one color, darker where the surface faces away from a lamp: viewers show vertex colors unlit.
void paint(Mesh& mesh, const std::array<float, 3>& color) {
  const Eigen::Vector3f lamp = Eigen::Vector3f(0.3f, -0.8f, -0.5f).normalized();  // in the world, y down
  mesh.colors.resize(mesh.positions.size());
  for (std::size_t v = 0; v < mesh.colors.size(); ++v) {
    const float light = 0.8f + 0.2f * mesh.normals[v].dot(lamp);
    for (std::size_t c = 0; c < 3; ++c) mesh.colors[v][c] = static_cast<std::uint8_t>(std::lround(color[c] * light));
    mesh.colors[v][3] = 255;
  }
}

/// Surface collected so far.
struct CollectedSurface {
  std::vector<Mesh> unchanged, added, removed;
  double common_before = 0, common_after = 0;  // m2 observed by the other map as well
};

void collect(const MapChunks& before, const MapChunks& after, const std::vector<Brick>& part, int reach,
             CollectedSurface& to, ChangedRegions& added, ChangedRegions& removed) {
  const auto bricks_of = [&](const MapChunks& map) {
    std::vector<Brick> bricks;
    std::set_intersection(part.begin(), part.end(), map.bricks.begin(), map.bricks.end(), std::back_inserter(bricks),
                          cairn::before);
    return bricks;
  };
  before.load_around(part);
  after.load_around(part);
  const float voxel = after.voxel_size();
  if (const std::vector<Brick> bricks = bricks_of(after); !bricks.empty()) {
    const Compared current = compare(after.polygonizer.polygonize(after.volume, bricks), before, reach);
    for (const auto& t : current.mesh.triangles) {
      if (current.is_observed(t)) to.common_after += area_of(current.mesh, t);
      if (current.is_changed(t)) added.add(current.mesh, t);
    }
    to.unchanged.push_back(simplified(extracted(current.mesh, [&](const auto& t) { return !current.is_changed(t); }),
                                      kMaxSimplifyError * voxel));
    to.added.push_back(extracted(current.mesh, [&](const auto& t) { return current.is_changed(t); }));
  }
  if (const std::vector<Brick> bricks = bricks_of(before); !bricks.empty()) {
    const Compared previous = compare(before.polygonizer.polygonize(before.volume, bricks), after, reach);
    for (const auto& t : previous.mesh.triangles) {
      if (previous.is_observed(t)) to.common_before += area_of(previous.mesh, t);
      if (previous.is_changed(t)) removed.add(previous.mesh, t);
    }
    to.removed.push_back(extracted(previous.mesh, [&](const auto& t) { return previous.is_changed(t); }));
  }
  malloc_trim(0);  // limits memory growth from part to part
}

double sum_of(const std::vector<ChangedRegion>& regions, bool added) {
  double sum = 0;
  for (const ChangedRegion& region : regions) sum += region.is_new == added ? region.area : 0;
  return sum;
}

double area_of(const std::vector<Mesh>& meshes) {
  double sum = 0;
  for (const Mesh& mesh : meshes)
    for (const auto& t : mesh.triangles) sum += area_of(mesh, t);
  return sum;
}

void check_common_frame(const ChangeSide& before, const ChangeSide& after, const CollectedSurface& collected,
                        const fs::path& file) {
  const double common = collected.common_before + collected.common_after,
               changed = area_of(collected.added) + area_of(collected.removed);
  constexpr const char* kRemedy =
      "put both recordings into one plan (cairn plan, then cairn change PLAN --since ...), or continue a copy of the "
      "first map (--resume)";
  if (common < kMinCommonArea)
    throw not_written(file,
                      fmt::format("{} and {} have no observed space in common: {}", before.name, after.name, kRemedy));
  if (changed > kMaxChangedRatio * common)
    throw not_written(file, fmt::format("{} and {} are not in the same frame: {:.0f} % of the surface observed by both "
                                        "differs: {}",
                                        before.name, after.name, 100 * changed / common, kRemedy));
}

/// Writes the collected surface.
std::size_t write(CollectedSurface& collected, const ChangedRegions& added, const ChangedRegions& removed,
                  const GravityAlignment& upright, const fs::path& file) {
  const auto is_kept = [](const Mesh& mesh, const ChangedRegions& regions) {
    return [&](const std::array<std::uint32_t, 3>& t) {
      return regions.contains(mesh.positions[t[0]]) && regions.contains(mesh.positions[t[1]]) &&
             regions.contains(mesh.positions[t[2]]);
    };
  };
  const Mesh all_new = welded(collected.added), all_gone = welded(collected.removed);
  collected.added.clear(), collected.removed.clear();
  const auto is_region = is_kept(all_new, added);
  collected.unchanged.push_back(extracted(all_new, [&](const auto& t) { return !is_region(t); }));
  Mesh unchanged = welded(collected.unchanged);
  collected.unchanged.clear();
  (void)clean(unchanged, {});
  GltfWriter gltf({.upright = upright, .file = file});
  std::size_t triangles = 0;
  const auto add = [&](const char* name, Mesh mesh, const std::array<float, 3>& color) {
    turn(mesh, upright.world_from_tracked);
    paint(mesh, color);
    triangles += gltf.add(name, mesh).triangles;
  };
  add("as before", std::move(unchanged), kGray);
  add("new", extracted(all_new, is_region), kNew);
  add("gone", extracted(all_gone, is_kept(all_gone, removed)), kGone);
  (void)gltf.write(file);
  return triangles;
}

}  // namespace

void check(const ChangeOptions& options, const fs::path& file) {
  if (!is_gltf(file))
    throw std::runtime_error(fmt::format("{}: '{}' is not a supported format for changes; use .glb or .gltf",
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
    if (side->map.bricks.empty()) throw not_written(file, side->name + " has no surface");
  const float distance = options.distance > 0 ? options.distance : kDefaultDistance * voxel;
  const int reach = static_cast<int>(std::lround(distance / voxel));
  if (reach < 1 || reach > kMaxDistance)
    throw std::runtime_error(
        fmt::format("ChangeOptions::distance is {}: with voxels of {} m it must be between {} and "
                    "{}, or 0",
                    options.distance, voxel, voxel, kMaxDistance * voxel));
  std::vector<Brick> bricks;
  std::set_union(before.map.bricks.begin(), before.map.bricks.end(), after.map.bricks.begin(), after.map.bricks.end(),
                 std::back_inserter(bricks), cairn::before);
  ChangedRegions added(true, after.map), removed(false, after.map);
  CollectedSurface collected;
  const auto parts = split_bricks(std::move(bricks));
  const int count = static_cast<int>(parts.size());
  for (int i = 0; i < count; ++i) {
    if (progress) progress(i, count + 1, "comparing");
    collect(before.map, after.map, parts[static_cast<std::size_t>(i)], reach, collected, added, removed);
  }
  if (progress) progress(count, count + 1, "writing");
  check_common_frame(before, after, collected, file);
  ExportedChange exported{.distance = static_cast<double>(static_cast<float>(reach) * voxel),
                          .new_area = 0,
                          .gone_area = 0,
                          .common_area = collected.common_after,
                          .regions = added.extract(static_cast<double>(options.min_area)),
                          .triangles = 0};
  const std::vector<ChangedRegion> regions = removed.extract(static_cast<double>(options.min_area));
  exported.regions.insert(exported.regions.end(), regions.begin(), regions.end());
  std::stable_sort(exported.regions.begin(), exported.regions.end(),
                   [](const ChangedRegion& a, const ChangedRegion& b) { return a.area > b.area; });
  exported.new_area = sum_of(exported.regions, true), exported.gone_area = sum_of(exported.regions, false);
  exported.triangles = write(collected, added, removed, after.map.upright, file);
  if (progress) progress(count + 1, count + 1, "done");
  return exported;
}

}  // namespace cairn
