// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/incremental_mesher.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <unordered_set>
#include <utility>

namespace cairn {
namespace {

constexpr double kMinNewFramesRatio = 0.5;  // share of the frames that had seen the cell at its last update
constexpr float kFullCoverageWeight = 8;    // observations at 1 m: 32 at 2 m, a second of a scan

std::vector<Brick> bricks_on_device(const Volume& volume, const Brick& cell) {
  std::vector<Brick> bricks;
  for (int x = 0; x < IncrementalMesher::kCell; ++x)
    for (int y = 0; y < IncrementalMesher::kCell; ++y)
      for (int z = 0; z < IncrementalMesher::kCell; ++z)
        if (const Brick b = cell * IncrementalMesher::kCell + Brick(x, y, z); volume.slot_of(b) != Volume::kNoSlot)
          bricks.push_back(b);
  return bricks;
}

/// Splits a mesh into cells by the triangles' centroids.
std::unordered_map<Brick, Mesh, BrickHash> by_cell(const Mesh& mesh, float cell_size) {
  struct Part {
    Mesh mesh;
    std::unordered_map<std::uint32_t, std::uint32_t> vertex;  // index in the cell's mesh, by index in the input
  };
  std::unordered_map<Brick, Part, BrickHash> meshes_by_cell;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3f centroid = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    Part& part = meshes_by_cell[(centroid / cell_size).array().floor().matrix().cast<int>()];
    std::array<std::uint32_t, 3> triangle;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [it, is_new] = part.vertex.try_emplace(t[k], static_cast<std::uint32_t>(part.mesh.positions.size()));
      if (is_new) {
        part.mesh.positions.push_back(mesh.positions[t[k]]);
        part.mesh.normals.push_back(mesh.normals[t[k]]);
        part.mesh.colors.push_back(mesh.colors[t[k]]);
        part.mesh.colors.back()[3] = coverage_of(mesh.weights[t[k]]);
      }
      triangle[k] = it->second;
    }
    part.mesh.triangles.push_back(triangle);
  }
  std::unordered_map<Brick, Mesh, BrickHash> meshes;
  for (auto& [cell, part] : meshes_by_cell) meshes.emplace(cell, std::move(part.mesh));
  return meshes;
}

/// Mean over the vertices, 0..1. The mesh must not be empty.
float mean_coverage(const Mesh& part) {
  int sum = 0;
  for (const auto& color : part.colors) sum += color[3];
  return static_cast<float>(sum) / (255 * static_cast<float>(part.colors.size()));
}

}  // namespace

std::uint8_t coverage_of(float weight) {
  return static_cast<std::uint8_t>(std::lround(255 * std::sqrt(std::clamp(weight / kFullCoverageWeight, 0.0f, 1.0f))));
}

void IncrementalMesher::change(std::span<const Brick> bricks) {
  std::unordered_set<Brick, BrickHash> cells;
  for (const Brick& brick : bricks) cells.insert(cell_of(brick, kCell));
  double sum = 0;
  int count = 0;
  for (const Brick& cell : cells) {
    CellState& state = cells_[cell];
    ++state.new_frames;
    if (state.coverage == kNoSurface) continue;
    sum += state.coverage;
    ++count;
  }
  if (count > 0) coverage_ = sum / count;
}

std::vector<SurfaceBlock> IncrementalMesher::take(Volume& volume, Polygonizer& polygonizer, int submap, int max_bricks,
                                                  bool all) {
  std::vector<std::pair<double, Brick>> due;
  for (const auto& [cell, state] : cells_)
    if (state.new_frames > (all ? 0 : kMinNewFramesRatio * state.frames))
      due.emplace_back(-state.new_frames / (1.0 + state.frames), cell);
  std::sort(due.begin(), due.end(), [](const auto& a, const auto& b) {
    const auto order = [](const auto& d) { return std::tuple(d.first, d.second.x(), d.second.y(), d.second.z()); };
    return order(a) < order(b);
  });
  std::vector<Brick> cells, bricks;
  for (const auto& [urgency, cell] : due) {
    const auto cell_bricks = bricks_on_device(volume, cell);
    if (cell_bricks.empty()) continue;
    if (!bricks.empty() && bricks.size() + cell_bricks.size() > static_cast<std::size_t>(max_bricks)) break;
    bricks.insert(bricks.end(), cell_bricks.begin(), cell_bricks.end());
    cells.push_back(cell);
  }
  auto meshes = by_cell(polygonizer.on_device(volume, bricks), volume.brick_size() * kCell);
  std::vector<SurfaceBlock> blocks;
  for (const Brick& cell : cells) {
    CellState& state = cells_[cell];
    const Mesh& mesh = meshes[cell];
    state = {.frames = state.frames + state.new_frames,
             .new_frames = 0,
             .coverage = mesh.colors.empty() ? kNoSurface : mean_coverage(mesh)};
    blocks.push_back({.submap = submap, .cell = cell, .mesh = std::move(meshes[cell])});
  }
  return blocks;
}

}  // namespace cairn
