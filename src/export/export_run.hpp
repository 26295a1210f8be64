// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// State of one export, shared by its steps.
#pragma once
#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/file_name.hpp"
#include "base/stopwatch.hpp"
#include "export/cells.hpp"
#include "export/export.hpp"
#include "geometry/mesh_vertices.hpp"
#include "mesh/gltf.hpp"

namespace cairn {

[[nodiscard]] inline bool is_gltf(const std::filesystem::path& file) {
  const std::string extension = extension_of(file);
  return extension == ".glb" || extension == ".gltf";
}
[[nodiscard]] inline bool is_tileset(const std::filesystem::path& file) { return extension_of(file) == ".json"; }

[[nodiscard]] inline std::runtime_error not_written(const std::filesystem::path& file, const std::string& why) {
  return std::runtime_error(file.string() + ": is not written: " + why);
}

/// Progress of an export by the cost of its steps: milliseconds of two busy CPU cores. Devices differ in speed, but
/// little in the ratio of the steps.
struct ProgressCost {
  static constexpr int kSteps = 1000;
  // Per brick: of a synthetic room with 8,400 and a kitchen with 17,600.
  static constexpr double kMesh = 0.1, kClean = 0.25, kSimplify = 0.38, kTexture = 0.13, kWrite = 0.03;
  static constexpr double kChartsFull = 0.46, kChartsBase = 0.04;  // by the ratio of triangles left
  static constexpr double kPoint = 0.0035;
  static constexpr double kKeyframe = 60;
  double charts = kChartsFull + kChartsBase, texture = kTexture;  // per brick, the latter with its share of keyframes
  double done = 0, total = 1;
  /// Out of kSteps, which is reached when all is written.
  [[nodiscard]] int share() const { return static_cast<int>((kSteps - 1) * std::clamp(done / total, 0.0, 1.0)); }
};

struct ExportRun {
  const ExportInput& input;
  const std::filesystem::path& file;
  const ExportOptions& options;
  const ExportProgress& progress;
  Cells cells;
  ExportReport exported;
  ProgressCost cost{};
  std::size_t triangles_left = 0;  // of SimplifyOptions::triangles, for the remaining cells
  double bricks_left = 0;          // in the remaining cells

  /// Adds the cost of a finished step to the progress.
  void step(double step_cost, const char* next) {
    cost.done += step_cost;
    if (progress) progress(cost.share(), ProgressCost::kSteps, next);
  }
  /// Reports the end of the export.
  void end() const {
    if (progress) progress(ProgressCost::kSteps, ProgressCost::kSteps, "done");
  }
  template <class Work>
  decltype(auto) timed(const char* stage, const Work& work) {
    return cairn::timed(exported.stage_ms, stage, work);
  }
  /// Approximate number of points for ExportOptions::point_spacing: a room at 2 cm has 682,306 points at 5 mm.
  [[nodiscard]] double expected_points() const {
    constexpr double kPointsPerBrick = 38;  // at a spacing of one voxel
    const double finer = static_cast<double>(input.volume.options().voxel_size / options.point_spacing);
    return kPointsPerBrick * static_cast<double>(input.bricks.size()) * finer * finer;
  }
  /// Approximate ratio of `triangles` to all triangles of the surface.
  [[nodiscard]] float ratio_of(std::size_t triangles) const {
    constexpr float kPointsPerBrick = 40;  // about: 30 where most surface was seen rarely, 60 for a desk
    return static_cast<float>(triangles) / (kPointsPerBrick * static_cast<float>(input.bricks.size()));
  }
  [[nodiscard]] bool simplifies() const {
    const SimplifyOptions& o = options.simplify;
    return o.triangles > 0 || o.ratio < 1 || o.max_error > 0;
  }
  void add_error(float error) { exported.error = std::max(exported.error, error); }
  void add(const GltfWriter::Added& added) {
    exported.parts += added.triangles > 0;
    exported.triangles += added.triangles;
    exported.vertices += added.vertices;
  }
  /// `left`: triangles, points or tiles.
  void refuse_empty(std::size_t left) const {
    if (left == 0)
      throw not_written(file,
                        "no surface is left: the map is empty, or CleanOptions::min_component, "
                        "CleanOptions::min_weight or SimplifyOptions::triangles removed all of it");
  }
  [[nodiscard]] GltfOptions gltf_options() const {
    return {.compression = options.compression,
            .png = options.texture.png,
            .jpeg_quality = options.texture.jpeg_quality,
            .lit = options.lit,
            .source = options.source,
            .upright = input.upright,
            .axes = is_tileset(file) ? Axes::automatic : options.axes,
            .is_single_mesh = cells.is_single()};
  }
  /// Mesh in the written world, with standard deviations.
  [[nodiscard]] Mesh as_written(Mesh mesh) const {
    mesh.sigmas = input.sigma.at_each(mesh.positions);
    return turned(std::move(mesh), input.upright.world_from_tracked);
  }
};

}  // namespace cairn
