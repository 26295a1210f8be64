// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/texturer.hpp"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/median.hpp"
#include "base/no_texture.hpp"

namespace cairn {
namespace {

constexpr std::uint64_t kViewMemory = std::uint64_t{160} << 20;  // bytes of keyframes on the device, 64 of 640x480
constexpr float kTypicalCoverage = 0.75f;                        // typical fraction of a texture covered by charts
constexpr float kMaxTexel = 0.5f;                                // voxels; of distant surface, and without a view
constexpr int kMaxTries = 40;                                    // each with coarser charts

std::vector<TextureKeyframe> keyframes_of(const ExportRun& run) {
  if (run.input.keyframes.empty())
    throw NoTexture(run.file.string() +
                    ": is not written: the map has no keyframes for a texture: keep them "
                    "(Options::keep_keyframes), or export without a texture");
  return run.input.keyframes;
}

/// Number of texels of the surface.
double texels_of(const Mesh& mesh, const std::vector<float>& sizes) {
  double texels = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.positions[t[0]];
    const float area = 0.5f * (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a).norm();
    const float size = std::min({sizes[t[0]], sizes[t[1]], sizes[t[2]]});
    texels += static_cast<double>(area / (size * size));
  }
  return texels;
}

void scale(std::vector<float>& values, float factor) {
  for (float& value : values) value *= factor;
}

}  // namespace

Texturer::Texturer(ExportRun& run)
    : run_(run),
      views_(run.input.volume, run.input.rig, run.input.surface, keyframes_of(run), run.input.get_image, kViewMemory) {
  run.exported.keyframes = static_cast<int>(views_.size());
  if (!views_.has_color())
    throw NoTexture(run.file.string() +
                    ": is not written: the keyframes have no color for a texture: export without "
                    "TextureOptions::enabled");
}

std::vector<float> Texturer::texel_sizes(const Mesh& mesh, int level) const {
  const TextureOptions& options = run_.options.texture;
  const float voxel_size = run_.input.volume.options().voxel_size;
  std::vector<float> sizes(mesh.positions.size(), options.texel);
  if (options.texel == 0) {
    sizes = views_.texel_sizes(mesh);
    for (float& size : sizes) size = std::min(size, kMaxTexel * voxel_size);
  }
  const auto max_texels = static_cast<double>(kTypicalCoverage) * options.max_size * options.max_size;
  scale(sizes, std::ldexp(1.0f, level));
  scale(sizes, static_cast<float>(std::max(1.0, std::sqrt(texels_of(mesh, sizes) / max_texels))));
  return sizes;
}

Mesh Texturer::texture(Mesh mesh, const CellMesh& part, int level) {
  if (mesh.triangles.empty()) return mesh;
  const int max_size = run_.options.texture.max_size;
  std::vector<float> sizes = texel_sizes(mesh, level);
  std::optional<TextureAtlas> atlas;
  std::future<void> images = std::async(std::launch::async, [&] { views_.preload(mesh); });  // beside the charts
  run_.timed("charts", [&] {
    for (int attempts = 0; !atlas; ++attempts) {
      if (attempts == kMaxTries)
        throw std::runtime_error("the surface does not fit into a texture: give a larger TextureOptions::max_size");
      if (attempts > 0) scale(sizes, 1.15f);
      atlas = pack(mesh, make_charts(mesh, sizes, max_size), max_size);
    }
  });
  const float texel = median(std::move(sizes));
  run_.timed("texture", [&] { images.get(); });
  mesh = {};  // as large as its texture
  run_.step(run_.cost.charts * part.bricks, "coloring");
  std::size_t points = 0;
  for (const TextureAtlas::Tile& tile : atlas->tiles)
    points += static_cast<std::size_t>(
        std::count_if(tile.triangles.begin(), tile.triangles.end(), [](std::uint32_t t) { return t != kNone; }));
  visible_texels_ += run_.timed("texture", [&] {
    return views_.blend(*atlas, part.colors.get(), [&](double share) {
      run_.step(run_.cost.texture * part.bricks * share, "coloring");
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
