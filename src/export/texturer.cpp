// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/texturer.hpp"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/no_texture.hpp"

namespace cairn {
namespace {

constexpr std::uint64_t kViewMemory = std::uint64_t{160} << 20;  // bytes of keyframes on the device, 64 of 640x480
constexpr float kTypicalCoverage = 0.75f;                        // typical fraction of a texture covered by charts
constexpr int kMaxTries = 40;                                    // each with coarser charts

std::vector<TextureKeyframe> keyframes_of(const ExportRun& run) {
  if (run.input.keyframes.empty())
    throw NoTexture(run.file.string() +
                    ": is not written: the map has no keyframes for a texture: keep them "
                    "(Options::keep_keyframes), or export without a texture");
  return run.input.keyframes;
}

double area_of(const Mesh& mesh) {
  double area = 0;
  for (const auto& t : mesh.triangles)
    area +=
        0.5 *
        static_cast<double>(
            (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm());
  return area;
}

}  // namespace

Texturer::Texturer(ExportRun& run)
    : run_(run),
      views_(run.input.volume, run.input.rig, run.input.surface, keyframes_of(run), run.input.get_image, kViewMemory) {
  run.exported.keyframes = static_cast<int>(views_.size());
  const bool has_color = run.timed("exposure", [&] {
    return views_.compensate_exposure([&] { run_.step(ProgressCost::kExposure, "comparing exposures"); });
  });
  if (!has_color)
    throw NoTexture(run.file.string() +
                    ": is not written: the keyframes have no color for a texture: export without "
                    "TextureOptions::enabled");
  run.timed("registration", [&] { views_.register_color(); });
  run.step(ProgressCost::kRegistration * static_cast<double>(views_.size()), "meshing");
  const shader::ColorCamera& c = views_.color_camera();
  run.exported.color_camera = {.rotation = {c.rotation.x, c.rotation.y, c.rotation.z},
                               .translation = {c.translation.x, c.translation.y, c.translation.z},
                               .focal_scale = c.focal_scale};
}

float Texturer::texel_size(const Mesh& mesh, int level) const {
  const TextureOptions& options = run_.options.texture;
  const auto max_size = static_cast<float>(options.max_size);
  float texel = options.texel > 0 ? options.texel : views_.texel_size(mesh);
  if (!(texel > 0)) texel = 0.25f * run_.input.volume.options().voxel_size;
  return std::max(std::ldexp(texel, level), static_cast<float>(std::sqrt(area_of(mesh) / kTypicalCoverage)) / max_size);
}

Mesh Texturer::texture(Mesh mesh, const CellMesh& part, int level) {
  if (mesh.triangles.empty()) return mesh;
  const int max_size = run_.options.texture.max_size;
  float texel = texel_size(mesh, level);
  std::optional<TextureAtlas> atlas;
  run_.timed("charts", [&] {
    for (int attempts = 0; !atlas; ++attempts, texel *= 1.15f) {
      if (attempts == kMaxTries)
        throw std::runtime_error("the surface does not fit into a texture: give a larger TextureOptions::max_size");
      atlas = pack(mesh, make_charts(mesh, texel, max_size), max_size);
    }
    texel /= 1.15f;
  });
  mesh = {};  // as large as its texture
  run_.step(run_.cost.charts * part.bricks, "coloring");
  std::size_t points = 0;
  for (const TextureAtlas::Tile& tile : atlas->tiles)
    points += static_cast<std::size_t>(
        std::count_if(tile.triangles.begin(), tile.triangles.end(), [](std::uint32_t t) { return t != kNone; }));
  visible_texels_ += run_.timed("texture", [&] {
    return views_.blend(*atlas, part.colors.get(), [&](double share) {
      run_.step(ProgressCost::kTexture * part.bricks * share, "coloring");
      malloc_trim(0);  // freed images, bricks and charts were fragmented
    });
  });
  ExportReport& exported = run_.exported;
  exported.texels += points;
  exported.textured_share =
      exported.texels == 0 ? 0 : static_cast<double>(visible_texels_) / static_cast<double>(exported.texels);
  exported.charts += atlas->charts;
  exported.texel = std::max(exported.texel, texel);
  ++exported.textures;
  return std::move(atlas->mesh);
}

}  // namespace cairn
