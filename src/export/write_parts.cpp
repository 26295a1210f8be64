// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <utility>

#include "export/texturer.hpp"
#include "export/write.hpp"
#include "mesh/formats.hpp"
#include "mesh/points.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// What a level of detail's file will hold.
struct Level {
  GltfWriter gltf;
  std::vector<Mesh> parts;  // of other formats
};

constexpr float kWorthwhile = 0.5f;  // of the triangles: a larger preview is none

struct Preview {
  GltfWriter gltf;
  float ratio;  // of the triangles
};

constexpr float kTrianglesOfABrick = 40;  // about: 30 where little was seen often, 60 of a desk

std::optional<Preview> preview_of(const ExportRun& run) {
  const PreviewOptions& options = run.options.preview;
  const float ratio =
      static_cast<float>(options.triangles) / (kTrianglesOfABrick * static_cast<float>(run.input.bricks.size()));
  if (options.file.empty() || !is_gltf(run.file) || ratio > kWorthwhile) return std::nullopt;
  GltfOptions gltf = run.gltf_options();
  gltf.compression = Compression::meshopt;
  return Preview{GltfWriter(gltf), ratio};
}

std::string name_of(const Cells& cells, const Cells::Key& cell) {
  return cells.all().size() == 1 ? "map" : fmt::format("cell {} {} {}", cell[0], cell[1], cell[2]);
}

void add_to(Preview& preview, ExportRun& run, Texturer* texturer, const Cells::Key& cell, Part part) {
  simplify_part(run, part, {.ratio = preview.ratio}, 0, 0);
  const Mesh mesh = run.upright(texturer != nullptr ? texturer->texture(part, 1) : std::move(part.mesh));
  run.timed("write", [&] { (void)preview.gltf.add(name_of(run.cells, cell), mesh); });
}

void add_cell(ExportRun& run, Texturer* texturer, const Cells::Key& cell, std::vector<Level>& levels,
              std::optional<Preview>& preview) {
  Part part = make_part(run, texturer, cell);
  run.step("simplifying");
  if (preview) add_to(*preview, run, texturer, cell, part);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const int level = static_cast<int>(i);
    // Cells of one file stay cells at every level.
    simplify_part(run, part, level == 0 ? run.options.simplify : SimplifyOptions{.ratio = kLevelRatio}, 0, level);
    run.moved_by(part.error);
    Mesh mesh = run.upright(texturer != nullptr ? texturer->texture(part, level) : part.mesh);
    GltfWriter::Added added{mesh.triangles.size(), mesh.positions.size()};
    if (is_gltf(run.file))
      run.timed("write", [&] { added = levels[i].gltf.add(name_of(run.cells, cell), mesh); });
    else
      levels[i].parts.push_back(std::move(mesh));
    if (level == 0) run.add(added);
  }
  run.step("meshing");
}

/// The paths, and a camera for each keyframe.
void add_cameras(const ExportInput& input, GltfWriter& gltf) {
  std::vector<Eigen::Isometry3d> cameras;
  const Eigen::Isometry3d turn(input.upright.world_from_tracked);
  for (const TextureKeyframe& k : input.keyframes) cameras.push_back(turn * k.world_from_camera);
  for (std::size_t i = 0; i < input.paths.size(); ++i)
    gltf.add_cameras(input.rig.depth, input.paths[i], i == 0 ? cameras : std::vector<Eigen::Isometry3d>{});
}

void write_level(const ExportRun& run, const fs::path& file, Level& level) {
  if (is_gltf(file)) {
    if (run.options.cameras) add_cameras(run.input, level.gltf);
    level.gltf.write(file);
  } else if (file.extension() == ".obj") {
    write_obj(file, level.parts, {.png = run.options.texture.png, .jpeg_quality = run.options.texture.jpeg_quality});
  } else {
    write_ply(file, joined(level.parts));
  }
}

}  // namespace

void write_points(ExportRun& run) {
  SurfacePoints points(run.options.point_spacing);
  for (const auto& [cell, bricks] : run.cells.all()) {
    const Part part = make_part(run, nullptr, cell);
    run.step("spreading points");
    run.timed("points", [&] { points.add(run.upright(part.mesh)); });
    run.step("meshing");
  }
  run.exported.points = points.points().positions.size();
  run.refuse_empty(run.exported.points);
  run.timed("write", [&] { write_ply(run.file, points.points()); });
}

void write_parts(ExportRun& run, Texturer* texturer) {
  std::vector<Level> levels;
  levels.reserve(static_cast<std::size_t>(run.options.levels));
  GltfOptions gltf = run.gltf_options();
  if (is_gltf(run.file)) gltf.file = run.file;
  for (int i = 0; i < run.options.levels; ++i) levels.push_back({GltfWriter(gltf), {}});
  std::optional<Preview> preview = preview_of(run);
  for (const auto& [cell, bricks] : run.cells.all()) add_cell(run, texturer, cell, levels, preview);
  run.refuse_empty(run.exported.triangles);
  run.timed("write", [&] {
    for (std::size_t i = levels.size(); i-- > 0;) {
      fs::path file = run.file;
      if (i > 0) file.replace_extension(fmt::format("lod{}{}", i, run.file.extension().string()));
      write_level(run, file, levels[i]);
    }
    if (preview) preview->gltf.write(run.options.preview.file);
  });
}

}  // namespace cairn
