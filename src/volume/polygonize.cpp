// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/polygonize.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "base/mesh_vertices.hpp"
#include "spirv/polygonize_classify.comp.h"
#include "spirv/polygonize_triangles.comp.h"
#include "spirv/polygonize_vertices.comp.h"

namespace cairn {
namespace {

constexpr int kCell = 8;  // bricks a side of the parts that are paged in one after the other; with their
                          // neighbours they fit into the smallest pool
constexpr std::size_t kMaxBricks = 16384;  // of one dispatch

bool by_cell(const Brick& a, const Brick& b) { return before_by_cell(a, b, kCell); }

Brick corner(std::uint32_t c) {
  return {static_cast<int>(c & 1), static_cast<int>(c >> 1 & 1), static_cast<int>(c >> 2)};
}

/// What a part needs on the device: its bricks and all their neighbours.
std::vector<Brick> with_neighbours(std::span<const Brick> bricks) {
  std::vector<Brick> all;
  for (const Brick& b : bricks)
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z) all.push_back(b + Brick(x, y, z));
  std::sort(all.begin(), all.end(), by_cell);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

bool is_on_device(const Volume& volume, const Brick& brick) { return volume.slot_of(brick) != Volume::kNoSlot; }

}  // namespace

Polygonizer::Polygonizer(gpu::Device& device)
    : device_(device),
      table_(device, 256 * shader::kTableRow * 4),
      classify_(device, "polygonize_classify", polygonize_classify_comp),
      vertices_(device, "polygonize_vertices", polygonize_vertices_comp),
      triangles_(device, "polygonize_triangles", polygonize_triangles_comp) {
  const auto table = marching_cubes_table();
  gpu::Batch batch(device);
  batch.upload(table_, std::span<const std::uint32_t>(table));
  batch.run();
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
  // Cells reach into + neighbours, which own some of their edges.
  std::unordered_map<Brick, bool, BrickHash> is_wanted;
  for (const Brick& b : wanted)
    if (exists(b)) is_wanted[b] = true;
  std::vector<Brick> bricks;
  for (const Brick& b : wanted)
    for (std::uint32_t c = 1; c < 8; ++c)
      if (const Brick neighbour = b + corner(c); !is_wanted.contains(neighbour) && exists(neighbour))
        is_wanted[neighbour] = false;
  bricks.reserve(is_wanted.size());
  for (const auto& [brick, unused] : is_wanted) bricks.push_back(brick);
  std::sort(bricks.begin(), bricks.end(), by_cell);
  // Those that make triangles come first.
  const auto makers = static_cast<std::size_t>(
      std::stable_partition(bricks.begin(), bricks.end(), [&](const Brick& b) { return is_wanted.at(b); }) -
      bricks.begin());
  Mesh mesh;
  if (bricks.empty()) return mesh;
  std::unordered_map<Brick, std::uint32_t, BrickHash> position;
  for (std::size_t i = 0; i < bricks.size(); ++i) position.emplace(bricks[i], static_cast<std::uint32_t>(i));
  std::vector<std::uint32_t> neighbours(8 * bricks.size(), 0);
  for (std::size_t i = 0; i < bricks.size(); ++i)
    for (std::uint32_t c = 0; c < 8; ++c)
      if (const auto it = position.find(bricks[i] + corner(c)); it != position.end())
        neighbours[8 * i + c] = it->second;

  const std::size_t n = bricks.size();
  const gpu::Buffer brick_list(device_, n * sizeof(shader::ivec3)), masks(device_, n * shader::kEdgeWords * 4);
  const gpu::Buffer firsts(device_, n * shader::kEdgeWords * 4), cells(device_, n * 512);
  const gpu::Buffer counts(device_, n * 64 * 4), neighbour_list(device_, n * 32);
  gpu::Batch batch(device_);
  {
    const std::vector<shader::ivec3> list(bricks.begin(), bricks.end());
    batch.upload(brick_list, list);
    batch.upload(neighbour_list, neighbours);
    batch.fill(masks, 0);
    batch.run();
  }

  std::vector<std::uint32_t> first_of_word(n * shader::kEdgeWords), triangles_of_column(n * 64);
  std::vector<shader::MeshVertex> part_vertices;
  for (std::size_t begin = 0; begin < n;) {
    std::size_t end = begin + 1;
    while (end < n && end - begin < kMaxBricks &&
           (resident || cell_of(bricks[end], kCell) == cell_of(bricks[begin], kCell)))
      ++end;
    const auto part = std::span(bricks).subspan(begin, end - begin);
    if (!resident) {
      volume.move_window((cell_of(part[0], kCell).cast<double>().array() + 0.5).matrix() * kCell * volume.brick_size());
      volume.page_in(with_neighbours(part));
    }
    const auto count = static_cast<std::uint32_t>(part.size());
    const shader::PolygonizePush push{.volume = volume.view(),
                                      .first = static_cast<std::uint32_t>(begin),
                                      .count = count,
                                      .min_weight = volume.options().min_mesh_weight,
                                      .cells = shader::address(cells),
                                      .triangles = shader::address(counts)};
    const std::span part_words =
        std::span(first_of_word).subspan(begin * shader::kEdgeWords, count * shader::kEdgeWords);
    classify_(batch, {64 * count, 1, 1}, push, {&volume.page_table(), &brick_list, &table_, &masks});
    batch.download(masks, part_words, begin * shader::kEdgeWords * 4);
    batch.download(counts, std::span(triangles_of_column).subspan(begin * 64, count * 64), begin * 64 * 4);
    batch.run();

    const std::size_t before = mesh.positions.size();
    auto total = static_cast<std::uint32_t>(before);
    for (std::uint32_t& word : part_words)
      total += static_cast<std::uint32_t>(std::popcount(std::exchange(word, total)));
    batch.upload(firsts, std::span<const std::uint32_t>(part_words), begin * shader::kEdgeWords * 4);
    part_vertices.resize(total - before);
    const gpu::Buffer vertex_buffer(device_, part_vertices.size() * sizeof(shader::MeshVertex));
    vertices_(batch, {count * shader::kEdgeWords, 1, 1}, push,
              {&volume.page_table(), &brick_list, &masks, &firsts, &vertex_buffer});
    batch.download(vertex_buffer, part_vertices);
    batch.run();
    for (const auto& v : part_vertices) {
      mesh.positions.emplace_back(v.position);
      mesh.normals.emplace_back(v.normal);
      mesh.colours.push_back(std::bit_cast<std::array<std::uint8_t, 4>>(v.colour | 0xff000000u));
      mesh.weights.push_back(v.weight);
    }
    begin = end;
  }

  // Triangles need no voxels, so the parts no longer matter. Bricks that were not asked for make none.
  std::vector<std::uint32_t> first_of_column(n * 64);
  std::uint32_t total = 0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t column = 64 * i; column < 64 * (i + 1); ++column) {
      first_of_column[column] = total;
      if (i < makers) total += triangles_of_column[column];
    }
  }
  batch.upload(counts, first_of_column);
  batch.run();
  mesh.triangles.resize(total);
  for (std::size_t begin = 0, end = 0; begin < makers; begin = end) {
    end = std::min(begin + kMaxBricks, makers);
    const std::size_t first = first_of_column[64 * begin], last = end < n ? first_of_column[64 * end] : total;
    const gpu::Buffer indices(device_, (last - first) * 12);
    const auto count = static_cast<std::uint32_t>(end - begin);
    triangles_(batch, {64 * count, 1, 1},
               {.volume = volume.view(),
                .first = static_cast<std::uint32_t>(begin),
                .count = count,
                .min_weight = 0,
                .cells = shader::address(cells),
                .triangles = shader::address(counts)},
               {&volume.page_table(), &brick_list, &table_, &masks, &firsts, &neighbour_list, &indices});
    batch.download(indices, std::span(mesh.triangles).subspan(first, last - first));
    batch.run();
  }
  (void)drop_unused_vertices(mesh);
  return mesh;
}

}  // namespace cairn
