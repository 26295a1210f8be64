// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/polygonize.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "geometry/mesh_vertices.hpp"
#include "spirv/polygonize_classify.comp.h"
#include "spirv/polygonize_triangles.comp.h"
#include "spirv/polygonize_vertices.comp.h"

namespace cairn {
namespace {

// Bricks per side of a region. Regions are paged in successively; a region with its neighbors fits into the smallest
// pool. A cell is a cube of eight voxels, as in marching cubes.
constexpr int kRegionBricks = 8;
constexpr std::size_t kMaxBricks = 16384;  // per dispatch

bool by_region(const Brick& a, const Brick& b) { return before_by_cell(a, b, kRegionBricks); }

Brick corner(std::uint32_t c) {
  return {static_cast<int>(c & 1), static_cast<int>(c >> 1 & 1), static_cast<int>(c >> 2)};
}

/// Bricks needed on the device for a region: its own and all their neighbors.
std::vector<Brick> with_neighbors(std::span<const Brick> bricks) {
  std::vector<Brick> all;
  for (const Brick& b : bricks)
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z) all.push_back(b + Brick(x, y, z));
  std::sort(all.begin(), all.end(), by_region);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

bool is_on_device(const Volume& volume, const Brick& brick) { return volume.slot_of(brick) != Volume::kNoSlot; }

struct Plan {
  std::vector<Brick> bricks;             // bricks with triangles first, then the owners of their remaining edges
  std::size_t makers = 0;                // number of bricks with triangles
  std::vector<std::uint32_t> neighbors;  // 8 per brick: indices in `bricks` of the bricks at its corners; 0 if missing
};

Plan plan_for(std::span<const Brick> wanted, const std::function<bool(const Brick&)>& exists) {
  // Cells extend into the upper neighbors, which own some of their edges.
  std::unordered_map<Brick, bool, BrickHash> is_wanted;
  for (const Brick& b : wanted)
    if (exists(b)) is_wanted[b] = true;
  Plan plan;
  std::vector<Brick>& bricks = plan.bricks;
  for (const Brick& b : wanted)
    for (std::uint32_t c = 1; c < 8; ++c)
      if (const Brick neighbor = b + corner(c); !is_wanted.contains(neighbor) && exists(neighbor))
        is_wanted[neighbor] = false;
  bricks.reserve(is_wanted.size());
  for (const auto& [brick, unused] : is_wanted) bricks.push_back(brick);
  std::sort(bricks.begin(), bricks.end(), by_region);
  plan.makers = static_cast<std::size_t>(
      std::stable_partition(bricks.begin(), bricks.end(), [&](const Brick& b) { return is_wanted.at(b); }) -
      bricks.begin());
  std::unordered_map<Brick, std::uint32_t, BrickHash> position;
  for (std::size_t i = 0; i < bricks.size(); ++i) position.emplace(bricks[i], static_cast<std::uint32_t>(i));
  plan.neighbors.resize(8 * bricks.size(), 0);
  for (std::size_t i = 0; i < bricks.size(); ++i)
    for (std::uint32_t c = 0; c < 8; ++c)
      if (const auto it = position.find(bricks[i] + corner(c)); it != position.end())
        plan.neighbors[8 * i + c] = it->second;
  return plan;
}

}  // namespace

/// Intermediate buffers of the kernels, by brick of the plan.
struct Polygonizer::Work {
  Work(gpu::Device& device, const Plan& of)
      : plan(of),
        brick_list(device, plan.bricks.size() * sizeof(shader::ivec3)),
        masks(device, plan.bricks.size() * shader::kEdgeWords * 4),
        firsts(device, plan.bricks.size() * shader::kEdgeWords * 4),
        cells(device, plan.bricks.size() * 512),
        counts(device, plan.bricks.size() * 64 * 4),
        neighbors(device, plan.bricks.size() * 32),
        triangles_of_column(plan.bricks.size() * 64) {
    const std::vector<shader::ivec3> list(plan.bricks.begin(), plan.bricks.end());
    gpu::Batch batch(device);
    batch.upload(brick_list, list);
    batch.upload(neighbors, plan.neighbors);
    batch.fill(masks, 0);
    batch.submit();
  }
  /// Push constants for the bricks from `begin` to `end`.
  [[nodiscard]] shader::PolygonizePush push(const Volume& volume, std::size_t begin, std::size_t end) const {
    return {.volume = volume.view(),
            .first = static_cast<std::uint32_t>(begin),
            .count = static_cast<std::uint32_t>(end - begin),
            .min_weight = volume.options().min_mesh_weight,
            .cells = shader::address(cells),
            .triangles = shader::address(counts)};
  }
  const Plan& plan;
  gpu::Buffer brick_list, masks, firsts, cells, counts, neighbors;  // firsts: index of the first vertex by word of the
                                                                    // masks
  std::vector<std::uint32_t> triangles_of_column;
  std::vector<shader::MeshVertex> vertices;  // of one dispatch
};

Polygonizer::Polygonizer(gpu::Device& device)
    : device_(device),
      table_(device, 256 * shader::kTableRow * 4),
      classify_(device, "polygonize_classify", polygonize_classify_comp),
      vertices_(device, "polygonize_vertices", polygonize_vertices_comp),
      triangles_(device, "polygonize_triangles", polygonize_triangles_comp) {
  const auto table = marching_cubes_table();
  gpu::Batch batch(device);
  batch.upload(table_, std::span<const std::uint32_t>(table));
  batch.submit();
}

Mesh Polygonizer::polygonize(Volume& volume) { return polygonize(volume, volume.bricks()); }

Mesh Polygonizer::polygonize(Volume& volume, std::span<const Brick> bricks) {
  const auto all = volume.bricks();
  const bool resident = std::all_of(all.begin(), all.end(), [&](const Brick& b) { return is_on_device(volume, b); });
  const std::unordered_set<Brick, BrickHash> exists(all.begin(), all.end());
  return polygonize(
      volume, bricks, [&](const Brick& b) { return exists.contains(b); }, resident);
}

Mesh Polygonizer::on_device(Volume& volume, std::span<const Brick> bricks) {
  return polygonize(
      volume, bricks, [&](const Brick& b) { return is_on_device(volume, b); }, true);
}

Mesh Polygonizer::polygonize(Volume& volume, std::span<const Brick> wanted,
                             const std::function<bool(const Brick&)>& exists, bool resident) {
  const Plan plan = plan_for(wanted, exists);
  Mesh mesh;
  if (plan.bricks.empty()) return mesh;
  Work work(device_, plan);
  for (std::size_t begin = 0, end = 0; begin < plan.bricks.size(); begin = end) {
    const Brick region = cell_of(plan.bricks[begin], kRegionBricks);
    end = begin + 1;
    while (end < plan.bricks.size() && end - begin < kMaxBricks &&
           (resident || cell_of(plan.bricks[end], kRegionBricks) == region))
      ++end;
    if (!resident) {
      const std::vector<Brick> needed = with_neighbors(std::span(plan.bricks).subspan(begin, end - begin));
      volume.move_window_to(needed);
      volume.page_in(needed);
    }
    add_vertices(volume, work, begin, end, mesh);
  }
  add_triangles(volume, work, mesh);
  (void)drop_unused_vertices(mesh);
  return mesh;
}

/// Classifies the cells of the bricks from `begin` to `end`, which are on the device, and creates their vertices.
void Polygonizer::add_vertices(const Volume& volume, Work& work, std::size_t begin, std::size_t end, Mesh& mesh) {
  const shader::PolygonizePush push = work.push(volume, begin, end);
  std::vector<std::uint32_t> words(push.count * shader::kEdgeWords);
  gpu::Batch batch(device_);
  classify_(batch, {64 * push.count, 1, 1}, push, {&volume.page_table(), &work.brick_list, &table_, &work.masks});
  batch.download(work.masks, words, begin * shader::kEdgeWords * 4);
  batch.download(work.counts, std::span(work.triangles_of_column).subspan(begin * 64, push.count * 64), begin * 64 * 4);
  batch.run();

  const std::size_t before = mesh.positions.size();
  auto total = static_cast<std::uint32_t>(before);
  for (std::uint32_t& word : words) total += static_cast<std::uint32_t>(std::popcount(std::exchange(word, total)));
  batch.upload(work.firsts, words, begin * shader::kEdgeWords * 4);
  std::vector<shader::MeshVertex>& vertices = work.vertices;
  vertices.resize(total - before);
  const gpu::Buffer vertex_buffer(device_, vertices.size() * sizeof(shader::MeshVertex));
  vertices_(batch, {push.count * shader::kEdgeWords, 1, 1}, push,
            {&volume.page_table(), &work.brick_list, &work.masks, &work.firsts, &vertex_buffer});
  batch.download(vertex_buffer, vertices);
  batch.run();
  // Room for all vertices, by those of the bricks so far.
  const double expected = 1.1 * total * static_cast<double>(work.plan.bricks.size()) / static_cast<double>(end);
  const auto grow = [&](auto& by_vertex) {
    if (by_vertex.capacity() < total)
      by_vertex.reserve(std::max<std::size_t>(total, static_cast<std::size_t>(expected)));
    by_vertex.resize(total);
  };
  grow(mesh.positions);
  grow(mesh.normals);
  grow(mesh.colors);
  grow(mesh.weights);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, vertices.size()), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const shader::MeshVertex& v = vertices[i];
      mesh.positions[before + i] = v.position;
      mesh.normals[before + i] = v.normal;
      mesh.colors[before + i] = std::bit_cast<std::array<std::uint8_t, 4>>(v.color | 0xff000000u);
      mesh.weights[before + i] = v.weight;
    }
  });
}

/// Creates the triangles. No voxels are read, so the bricks need not be on the device.
void Polygonizer::add_triangles(const Volume& volume, Work& work, Mesh& mesh) {
  const std::size_t bricks = work.plan.bricks.size(), makers = work.plan.makers;
  std::vector<std::uint32_t> first_of_column(bricks * 64);
  std::uint32_t total = 0;
  for (std::size_t column = 0; column < first_of_column.size(); ++column) {
    first_of_column[column] = total;
    if (column < 64 * makers) total += work.triangles_of_column[column];
  }
  gpu::Batch batch(device_);
  batch.upload(work.counts, first_of_column);
  batch.submit();
  mesh.triangles.resize(total);
  for (std::size_t begin = 0, end = 0; begin < makers; begin = end) {
    end = std::min(begin + kMaxBricks, makers);
    const std::size_t first = first_of_column[64 * begin], last = end < bricks ? first_of_column[64 * end] : total;
    const gpu::Buffer indices(device_, (last - first) * 12);
    const shader::PolygonizePush push = work.push(volume, begin, end);
    triangles_(batch, {64 * push.count, 1, 1}, push,
               {&volume.page_table(), &work.brick_list, &table_, &work.masks, &work.firsts, &work.neighbors, &indices});
    batch.download(indices, std::span(mesh.triangles).subspan(first, last - first));
    batch.run();
  }
}

}  // namespace cairn
