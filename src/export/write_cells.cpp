// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "base/file_name.hpp"
#include "base/memory.hpp"
#include "export/texturer.hpp"
#include "export/write.hpp"
#include "mesh/formats.hpp"
#include "mesh/points.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Contents of the file of a level of detail.
struct Level {
  GltfWriter gltf;
  std::vector<Mesh> parts;  // of other formats
};

constexpr float kMaxPreviewRatio = 0.5f;  // of the triangles: a larger preview keeps all of them
constexpr int kPreviewJpegQuality = 80;

struct Preview {
  GltfWriter gltf;
  float ratio;  // of the triangles; 1: all
};

constexpr double kBytesPerPoint = 180;   // in memory: the point, the file's bytes, and the occupied cubes
constexpr double kMaxMemoryRatio = 0.5;  // of the available memory
constexpr double kMinSpacing = 0.1;      // voxels: closer points add no information

std::optional<Preview> preview_of(const ExportRun& run) {
  const PreviewOptions& options = run.options.preview;
  const float ratio = run.ratio_of(options.triangles);
  if (options.file.empty() || !is_gltf(run.file)) return std::nullopt;
  GltfOptions gltf = run.gltf_options();
  gltf.compression = Compression::meshopt;
  gltf.jpeg_quality = std::min(gltf.jpeg_quality, kPreviewJpegQuality);
  return Preview{GltfWriter(gltf), ratio > kMaxPreviewRatio ? 1 : ratio};
}

std::string name_of(const Cells& cells, const Cells::Key& cell) {
  return cells.all().size() == 1 ? "map" : fmt::format("cell {} {} {}", cell[0], cell[1], cell[2]);
}

/// Texture of half the size.
Texture halved(const Texture& texture) {
  Texture half{.width = (texture.width + 1) / 2, .height = (texture.height + 1) / 2, .texels = {}};
  half.texels.resize(static_cast<std::size_t>(half.width) * static_cast<std::size_t>(half.height));
  if (half.texels.empty()) return half;
  cv::Mat to(half.height, half.width, CV_8UC3, half.texels.data());
  const cv::Mat from(texture.height, texture.width, CV_8UC3,
                     const_cast<std::array<std::uint8_t, 3>*>(texture.texels.data()));
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  return half;
}

/// Adds a mesh of the finest level, with a smaller texture.
void add_to(Preview& preview, ExportRun& run, const Cells::Key& cell, Mesh& mesh) {
  run.timed("write", [&] {
    Texture full = std::exchange(mesh.texture, {});
    mesh.texture = halved(full);
    (void)preview.gltf.add(name_of(run.cells, cell), mesh);
    mesh.texture = std::move(full);
  });
}

void add_simplified_to(Preview& preview, ExportRun& run, Texturer* texturer, const Cells::Key& cell, CellMesh part) {
  simplify_cell_mesh(run, part, {.ratio = preview.ratio}, 0, 0);
  run.step(ProgressCost::kSimplify * part.bricks, "simplifying");
  const Mesh mesh =
      run.as_written(texturer != nullptr ? texturer->texture(std::move(part.mesh), part, 1) : std::move(part.mesh));
  run.timed("write", [&] { (void)preview.gltf.add(name_of(run.cells, cell), mesh); });
}

void add_cell(ExportRun& run, Texturer* texturer, const Cells::Key& cell, std::vector<Level>& levels,
              std::optional<Preview>& preview) {
  CellMesh part = make_cell_mesh(run, texturer, cell);
  if (preview && preview->ratio < 1) add_simplified_to(*preview, run, texturer, cell, part);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const int level = static_cast<int>(i);
    // Cells of the same file stay separate at every level.
    if (level == 0) {
      simplify_finest(run, part);
    } else {
      simplify_cell_mesh(run, part, {.ratio = kLevelRatio}, 0, level);
      run.add_error(part.error);
    }
    Mesh simple = i + 1 == levels.size() ? std::move(part.mesh) : part.mesh;
    Mesh mesh =
        run.as_written(texturer != nullptr ? texturer->texture(std::move(simple), part, level) : std::move(simple));
    if (level == 0 && preview && preview->ratio >= 1) add_to(*preview, run, cell, mesh);
    GltfWriter::Added added{mesh.triangles.size(), mesh.positions.size()};
    if (is_gltf(run.file))
      run.timed("write", [&] { added = levels[i].gltf.add(name_of(run.cells, cell), mesh); });
    else
      levels[i].parts.push_back(std::move(mesh));
    if (level == 0) run.add(added);
    part.bricks *= static_cast<double>(kLevelRatio);  // remaining cost
  }
  run.step(ProgressCost::kWrite * static_cast<double>(run.cells.all().at(cell).size()), "meshing");
}

/// Adds the paths, and a camera for each keyframe.
void add_cameras(const ExportInput& input, GltfWriter& gltf) {
  std::vector<Eigen::Isometry3d> cameras;
  const Eigen::Isometry3d turn(input.upright.world_from_tracked);
  for (const TextureKeyframe& k : input.keyframes) cameras.push_back(turn * k.world_from_camera);
  for (std::size_t i = 0; i < input.paths.size(); ++i)
    gltf.add_cameras(input.rig.depth, input.paths[i], i == 0 ? cameras : std::vector<Eigen::Isometry3d>{});
}

/// Returns the files.
std::vector<fs::path> write_level(const ExportRun& run, const fs::path& file, Level& level) {
  if (is_gltf(file)) {
    if (run.options.cameras) add_cameras(run.input, level.gltf);
    return level.gltf.write(file);
  }
  const std::string extension = extension_of(file);
  if (extension == ".obj")
    return write_obj(
        file, level.parts,
        {.png = run.options.texture.png, .jpeg_quality = run.options.texture.jpeg_quality, .axes = run.options.axes});
  if (extension == ".usdz")
    write_usdz(file, level.parts, run.options.texture.jpeg_quality);
  else if (extension == ".stl")
    write_stl(file, level.parts, run.options.axes);
  else
    write_ply(file, joined(level.parts), run.options.axes);
  return {file};
}

/// Throws before points are made that would not fit into the memory.
void check_memory(const ExportRun& run) {
  const auto available = static_cast<double>(available_memory());
  const double count = run.expected_points(), bytes = kBytesPerPoint * count;
  if (available <= 0 || bytes < kMaxMemoryRatio * available) return;
  const double voxel = static_cast<double>(run.input.volume.options().voxel_size),
               fitting_spacing =
                   static_cast<double>(run.options.point_spacing) * std::sqrt(bytes / (kMaxMemoryRatio * available));
  const double min_spacing = std::max(kMinSpacing * voxel, fitting_spacing);
  const double step = std::pow(10, std::floor(std::log10(min_spacing)));  // rounded up to one digit
  throw not_written(run.file,
                    fmt::format("ExportOptions::point_spacing is {}: that gives about {:.0f} million points, which "
                                "need about {:.0f} GB of memory; {:.1f} GB are free; use {:.1g} or more",
                                run.options.point_spacing, 1e-6 * count, 1e-9 * bytes, 1e-9 * available,
                                step * std::ceil(min_spacing / step - 1e-6)));
}

}  // namespace

void write_points(ExportRun& run) {
  check_memory(run);
  SurfacePoints points(run.options.point_spacing);
  for (const auto& [cell, bricks] : run.cells.all()) {
    const CellMesh part = make_cell_mesh(run, nullptr, cell);
    run.timed("points", [&] { points.add(run.as_written(part.mesh)); });
    run.step(ProgressCost::kWrite * part.bricks + ProgressCost::kPoint * run.expected_points() * part.bricks /
                                                      static_cast<double>(run.input.bricks.size()),
             "meshing");
  }
  run.exported.points = points.points().positions.size();
  run.refuse_empty(run.exported.points);
  run.timed("write", [&] {
    if (extension_of(run.file) == ".las")
      write_las(run.file, points.points(), run.options.axes);
    else
      write_ply(run.file, points.points(), run.options.axes);
  });
  run.exported.files = {run.file};
}

void write_parts(ExportRun& run, Texturer* texturer) {
  std::vector<Level> levels;
  levels.reserve(static_cast<std::size_t>(run.options.levels));
  GltfOptions gltf = run.gltf_options();
  if (is_gltf(run.file)) gltf.file = run.file;
  for (int i = 0; i < run.options.levels; ++i) levels.push_back({GltfWriter(gltf), {}});
  std::optional<Preview> preview = preview_of(run);
  if (preview && preview->ratio < 1)
    run.cost.total += (ProgressCost::kSimplify + (texturer != nullptr ? run.cost.charts + run.cost.texture : 0)) *
                      static_cast<double>(run.input.bricks.size());
  for (const auto& [cell, bricks] : run.cells.all()) add_cell(run, texturer, cell, levels, preview);
  run.refuse_empty(run.exported.triangles);
  run.timed("write", [&] {
    for (std::size_t i = levels.size(); i-- > 0;) {
      fs::path file = run.file;
      if (i > 0) file.replace_extension(fmt::format("lod{}{}", i, run.file.extension().string()));
      const std::vector<fs::path> files = write_level(run, file, levels[i]);
      run.exported.files.insert(run.exported.files.begin(), files.begin(), files.end());
    }
    if (preview) {
      preview->gltf.write(run.options.preview.file);
      run.exported.files.push_back(run.options.preview.file);
    }
  });
}

}  // namespace cairn
