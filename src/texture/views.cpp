// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "texture/views.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "geometry/readout.hpp"
#include "spirv/texture_blend.comp.h"
#include "spirv/texture_blur.comp.h"
#include "spirv/texture_expose.comp.h"
#include "spirv/texture_prepare.comp.h"
#include "spirv/texture_reference.comp.h"
#include "spirv/texture_select.comp.h"

namespace cairn {
namespace {

constexpr float kDepthTolerance = 0.02f;   // meters in addition to the noise, maximum distance between the surface and
                                           // a keyframe's depth
constexpr std::size_t kBatchTiles = 4096;  // colored per dispatch
constexpr std::size_t kPreloadStep = 16;   // vertices tested for visibility: every n-th
constexpr double kMinColor = 12, kMaxColor = 250;  // of 255; others carry no information about exposure
constexpr double kMaxGain = 1.0;                   // limit of the logarithm
constexpr double kPriorShare = 0.5;  // weight of the image's mean gain in a cell, relative to all pixels of the cell

constexpr std::size_t kGainCells = std::size_t{shader::kGainColumns} * shader::kGainRows;

std::uint32_t pixels_of(const Camera& c) { return static_cast<std::uint32_t>(c.width * c.height); }

/// Interleaves the bits of three numbers: close points get close codes (Morton 1966).
std::uint64_t morton(const Eigen::Vector3f& p) {
  std::uint64_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto v = static_cast<std::uint64_t>(std::clamp((p[axis] + 1000.0f) * 8.0f, 0.0f, 2097151.0f));
    for (int bit = 0; bit < 21; ++bit) code |= (v >> bit & 1) << (3 * bit + axis);
  }
  return code;
}

}  // namespace

TextureViews::TextureViews(Volume& volume, const Rig& rig, const SurfaceOptions& options,
                           std::vector<TextureKeyframe> keyframes, GetImage get_image, std::uint64_t memory)
    : volume_(volume),
      device_(volume.device()),
      max_depth_(options.max_depth),
      preprocessor_(device_, with_global_shutter({rig.color_view(), rig.sensor}), options, 1, 1),
      in_color_(rig),
      camera_(preprocessor_.camera()),
      raycaster_(device_, camera_, options, 2, 1),
      keyframes_(std::move(keyframes)),
      get_image_(std::move(get_image)),
      capacity_(std::max<std::size_t>(16, memory / (pixels_of(camera_) * 8 + pixels_of(camera_) / 4))),
      slot_(keyframes_.size(), -1),
      prepare_(device_, "texture_prepare", texture_prepare_comp, shader::constants_of(rig.sensor)),
      blur_(device_, "texture_blur", texture_blur_comp),
      reference_(device_, "texture_reference", texture_reference_comp, shader::constants_of(rig.sensor)),
      expose_(device_, "texture_expose", texture_expose_comp),
      select_(device_, "texture_select", texture_select_comp, shader::constants_of(rig.sensor)),
      blend_(device_, "texture_blend", texture_blend_comp, shader::constants_of(rig.sensor)),
      map_colors_(device_, pixels_of(camera_) / 4),
      gains_(device_, kGainCells * sizeof(shader::vec3)) {
  const Eigen::Isometry3d depth_from_color = rig.depth_from_color();
  for (TextureKeyframe& k : keyframes_) {  // poses and velocities become those of the color camera
    k.world_from_camera = k.world_from_camera * depth_from_color;
    k.velocity = adjoint(depth_from_color.inverse()) * k.velocity;
    camera_from_world_.emplace_back(k.world_from_camera.inverse().cast<float>());
  }
}

const TextureViews::OnDevice& TextureViews::on_device(std::size_t keyframe) const {
  return *images_[static_cast<std::size_t>(slot_[keyframe])];
}

/// Loads keyframe images to the device, at most as many as its capacity.
void TextureViews::load_images(std::span<const std::size_t> keyframes) {
  ++use_;
  std::vector<std::size_t> missing;
  for (const std::size_t k : keyframes)
    if (slot_[k] >= 0)
      images_[static_cast<std::size_t>(slot_[k])]->last_use = use_;
    else
      missing.push_back(k);
  constexpr std::size_t kMaxBatch = 8;
  for (std::size_t begin = 0; begin < missing.size(); begin += kMaxBatch) {
    const auto some = std::span(missing).subspan(begin, std::min(kMaxBatch, missing.size() - begin));
    std::vector<Frame> frames(some.size());
    tbb::parallel_for(std::size_t{0}, some.size(),
                      [&](std::size_t i) { frames[i] = in_color_(get_image_(keyframes_[some[i]].image)); });
    for (std::size_t i = 0; i < some.size(); ++i) {
      if (images_.size() < capacity_) {
        images_.push_back(std::make_unique<OnDevice>());
        images_.back()->pixels = gpu::Buffer(device_, pixels_of(camera_) * 8);
        images_.back()->blurred = gpu::Buffer(device_, pixels_of(camera_) / 4);
        slot_[some[i]] = static_cast<int>(images_.size()) - 1;
      } else {
        const auto oldest = std::min_element(images_.begin(), images_.end(),
                                             [](const auto& a, const auto& b) { return a->last_use < b->last_use; });
        slot_[(*oldest)->keyframe] = -1;
        slot_[some[i]] = static_cast<int>(oldest - images_.begin());
      }
      OnDevice& image = *images_[static_cast<std::size_t>(slot_[some[i]])];
      image.keyframe = some[i];
      image.last_use = use_;
      const FramePyramid surface = preprocessor_.preprocess(frames[i]);
      surface.register_color_to_depth();
      image.has_color = surface.has_color;
      const Eigen::Isometry3d& pose = keyframes_[some[i]].world_from_camera;
      volume_.page_in_around(pose.translation());
      const SurfacePrediction model = raycaster_.raycast(volume_, pose);
      gpu::Batch batch(device_);
      const shader::TexturePreparePush push{shader::pinhole(camera_)};
      prepare_(batch, {pixels_of(camera_), 1, 1}, push, {surface.fusion, &model.levels[1]->points, &image.pixels});
      blur_(batch, {pixels_of(camera_) / 16, 1, 1}, push, {&image.pixels, &image.blurred});
      batch.submit();
      if (image.has_color) equalize(image, pose, model.levels[1]->points);
    }
  }
}

void TextureViews::equalize(OnDevice& image, const Eigen::Isometry3d& pose, const gpu::Buffer& model) {
  const shader::Pinhole camera = shader::pinhole(camera_);
  const std::uint32_t columns = camera.width / 4, rows = camera.height / 4;
  std::vector<std::uint32_t> colors(std::size_t{columns} * rows), map(colors.size());
  gpu::Batch compare(device_);
  reference_(compare, {columns * rows, 1, 1},
             {.volume = volume_.view(),
              .camera = camera,
              .world_from_camera = shader::rigid(pose),
              .tolerance = kDepthTolerance},
             volume_, {&volume_.page_table(), &image.pixels, &model, &map_colors_});
  compare.download(image.blurred, colors);
  compare.download(map_colors_, map);
  compare.run();
  const std::vector<shader::vec3> gains = exposure_gains(colors, map, columns);
  gpu::Batch batch(device_);
  batch.upload(gains_, gains);
  expose_(batch, {pixels_of(camera_), 1, 1}, {.width = camera.width, .height = camera.height, .words = 2},
          {&gains_, &image.pixels, &image.pixels});
  expose_(batch, {columns * rows, 1, 1}, {.width = columns, .height = rows, .words = 1},
          {&gains_, &image.blurred, &image.blurred});
  batch.submit();
}

bool TextureViews::has_color() {
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    load_images(std::array{k});
    if (on_device(k).has_color) return true;
  }
  return false;
}

void TextureViews::discard_images() {
  std::fill(slot_.begin(), slot_.end(), -1);
  images_.clear();
}

shader::TextureView TextureViews::view_of(std::size_t keyframe) const {
  const TextureKeyframe& k = keyframes_[keyframe];
  const OnDevice& image = on_device(keyframe);
  return {.camera_from_world = shader::rigid(k.world_from_camera.inverse()),
          .velocity = Eigen::Vector3f(k.velocity.tail<3>().cast<float>()),
          .turn_rate = Eigen::Vector3f(k.velocity.head<3>().cast<float>()),
          .delay = static_cast<float>(k.color_delay),
          .pixels = shader::address(image.pixels),
          .blurred = shader::address(image.blurred)};
}

bool TextureViews::may_see(std::size_t keyframe, const Eigen::Vector3f& point, const Eigen::Vector3f& normal) const {
  constexpr float kImageMargin = 24;  // pixels
  const Eigen::Isometry3f& t = camera_from_world_[keyframe];
  const Eigen::Vector3f p = t * point;
  if (p.z() < 0.05f || p.z() > 1.1f * max_depth_ || (t.linear() * normal).dot(p) > 0.1f * p.norm()) return false;
  const Eigen::Vector2d at = camera_.project(p.cast<double>());
  return at.x() > -kImageMargin && at.y() > -kImageMargin && at.x() < camera_.width + kImageMargin &&
         at.y() < camera_.height + kImageMargin;
}

std::vector<float> TextureViews::texel_sizes(const Mesh& mesh) const {
  std::vector<float> sizes(mesh.positions.size(), std::numeric_limits<float>::infinity());
  tbb::parallel_for(std::size_t{0}, sizes.size(), [&](std::size_t v) {
    for (std::size_t k = 0; k < keyframes_.size(); ++k)
      if (may_see(k, mesh.positions[v], mesh.normals[v]))
        sizes[v] = std::min(sizes[v], (camera_from_world_[k] * mesh.positions[v]).z() / static_cast<float>(camera_.fx));
  });
  return sizes;
}

std::vector<shader::vec3> exposure_gains(const std::vector<std::uint32_t>& colors,
                                         const std::vector<std::uint32_t>& map, std::size_t columns) {
  struct Sum {
    Eigen::Array3d logarithms = Eigen::Array3d::Zero(), count = Eigen::Array3d::Zero();
  };
  const std::size_t rows = colors.size() / columns;
  std::vector<Sum> cells(kGainCells);
  Sum all;
  for (std::size_t i = 0; i < colors.size(); ++i) {
    if (map[i] >> 24 == 0) continue;
    const std::size_t x = i % columns * shader::kGainColumns / columns, y = i / columns * shader::kGainRows / rows;
    Sum& cell = cells[y * shader::kGainColumns + x];
    for (int c = 0; c < 3; ++c) {
      const double from = colors[i] >> (8 * c) & 255, to = map[i] >> (8 * c) & 255;
      if (std::min(from, to) < kMinColor || std::max(from, to) > kMaxColor) continue;
      const double logarithm = std::clamp(std::log(to / from), -kMaxGain, kMaxGain);
      cell.logarithms[c] += logarithm, ++cell.count[c];
      all.logarithms[c] += logarithm, ++all.count[c];
    }
  }
  const Eigen::Array3d mean = all.logarithms / all.count.max(1);
  const double prior = kPriorShare * static_cast<double>(colors.size()) / static_cast<double>(kGainCells);
  std::vector<shader::vec3> gains;
  for (const Sum& cell : cells) {
    const Eigen::Array3d logarithm = (cell.logarithms + prior * mean) / (cell.count + prior);
    gains.emplace_back(Eigen::Vector3f(logarithm.exp().cast<float>()));
  }
  return gains;
}

struct TextureViews::Tile {
  std::uint64_t code;
  std::size_t index;  // in the atlas
  Eigen::Vector3f middle, normal;
};

/// Spatial order, so that adjacent tiles are colored together.
std::vector<TextureViews::Tile> TextureViews::in_morton_order(const TextureAtlas& atlas) {
  std::vector<Tile> order(atlas.tiles.size());
  tbb::parallel_for(std::size_t{0}, order.size(), [&](std::size_t i) {
    Tile& tile = order[i];
    tile.index = i;
    // The central point, or the next texel with a point.
    for (std::size_t k = 0; k < shader::kTileTexels; ++k) {
      const shader::Texel t = atlas.point(atlas.tiles[i], (27 + k) % shader::kTileTexels);
      if (t.normal == 0) continue;
      tile.middle = t.position;
      tile.normal = shader::unpack_normal(t.normal);
      break;
    }
    tile.code = morton(tile.middle);
  });
  std::sort(order.begin(), order.end(),
            [](const Tile& a, const Tile& b) { return std::tie(a.code, a.index) < std::tie(b.code, b.index); });
  return order;
}

std::vector<std::size_t> TextureViews::keyframes_that_see(std::span<const Tile> tiles) const {
  std::vector<int> visible_tiles(keyframes_.size(), 0);
  tbb::parallel_for(std::size_t{0}, keyframes_.size(), [&](std::size_t k) {
    for (const Tile& tile : tiles) visible_tiles[k] += may_see(k, tile.middle, tile.normal);
  });
  std::vector<std::size_t> selected;
  for (std::size_t k = 0; k < visible_tiles.size(); ++k)
    if (visible_tiles[k] > 0) selected.push_back(k);
  std::stable_sort(selected.begin(), selected.end(),
                   [&](std::size_t a, std::size_t b) { return visible_tiles[a] > visible_tiles[b]; });
  if (selected.size() > capacity_) selected.resize(capacity_);
  std::sort(selected.begin(), selected.end());
  return selected;
}

/// Buffers for coloring a batch of tiles: on the device, and on the host.
struct TextureViews::BlendBuffers {
  gpu::Buffer points, chosen, colors, views;
  std::vector<shader::Texel> tile_points;
  std::vector<std::uint32_t> tile_colors;
};

void TextureViews::blend_tiles(const TextureAtlas& atlas, std::span<const Tile> tiles, BlendBuffers& buffers) {
  const std::vector<std::size_t> selected = keyframes_that_see(tiles);
  load_images(selected);
  std::vector<shader::TextureView> views;
  for (const std::size_t k : selected)
    if (on_device(k).has_color) views.push_back(view_of(k));
  buffers.tile_points.resize(tiles.size() * shader::kTileTexels);
  tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
    for (std::size_t k = 0; k < shader::kTileTexels; ++k)
      buffers.tile_points[i * shader::kTileTexels + k] = atlas.point(atlas.tiles[tiles[i].index], k);
  });
  buffers.tile_colors.resize(buffers.tile_points.size());
  const auto count = static_cast<std::uint32_t>(tiles.size());
  const shader::TextureBlendPush push{.camera = shader::pinhole(camera_),
                                      .tiles = count,
                                      .views = static_cast<std::uint32_t>(views.size()),
                                      .tolerance = kDepthTolerance};
  gpu::Batch batch(device_);
  batch.upload(buffers.points, buffers.tile_points);
  batch.upload(buffers.views, views);
  select_(batch, {count, 1, 1}, push, {&buffers.points, &buffers.views, &buffers.chosen});
  blend_(batch, {count * shader::kTileTexels, 1, 1}, push,
         {&buffers.points, &buffers.views, &buffers.chosen, &buffers.colors});
  batch.download(buffers.colors, buffers.tile_colors);
  batch.run();
}

void TextureViews::preload(const Mesh& mesh) {
  std::vector<Tile> places;
  places.reserve(mesh.positions.size() / kPreloadStep + 1);
  for (std::size_t v = 0; v < mesh.positions.size(); v += kPreloadStep)
    places.push_back({.code = 0, .index = v, .middle = mesh.positions[v], .normal = mesh.normals[v]});
  const std::vector<std::size_t> selected = keyframes_that_see(places);
  if (selected.size() < capacity_) load_images(selected);
}

std::size_t TextureViews::blend(TextureAtlas& atlas, const VoxelColors* unseen,
                                const std::function<void(double share)>& step) {
  Texture& texture = atlas.mesh.texture;
  const auto size = static_cast<std::size_t>(texture.width) * static_cast<std::size_t>(texture.height);
  texture.texels.assign(size, {0, 0, 0});
  std::vector<bool> known(size, false);
  const std::vector<Tile> order = in_morton_order(atlas);
  const std::size_t batch_size = std::min(kBatchTiles, std::max<std::size_t>(order.size(), 1));
  BlendBuffers buffers{.points = {device_, batch_size * shader::kTileTexels * sizeof(shader::Texel)},
                       .chosen = {device_, batch_size * shader::kTileViews * 8},
                       .colors = {device_, batch_size * shader::kTileTexels * 4},
                       .views = {device_, std::max<std::size_t>(1, std::min(capacity_, keyframes_.size())) *
                                              sizeof(shader::TextureView)},
                       .tile_points = {},
                       .tile_colors = {}};
  std::size_t seen = 0;
  for (std::size_t begin = 0; begin < order.size(); begin += batch_size) {
    const auto tiles = std::span(order).subspan(begin, std::min(batch_size, order.size() - begin));
    blend_tiles(atlas, tiles, buffers);
    if (unseen != nullptr)
      tbb::parallel_for(std::size_t{0}, buffers.tile_points.size(), [&](std::size_t i) {
        const shader::Texel& point = buffers.tile_points[i];
        std::uint32_t& word = buffers.tile_colors[i];
        if (word >> 24 == 0 && point.normal != 0) word = unseen->at(point.position, word);
      });
    for (std::size_t i = 0; i < buffers.tile_points.size(); ++i) {
      if (buffers.tile_points[i].normal == 0) continue;
      const std::uint32_t word = buffers.tile_colors[i];
      const std::size_t texel = atlas.texel(atlas.tiles[tiles[i / shader::kTileTexels].index], i % shader::kTileTexels);
      known[texel] = true;
      seen += word >> 24 != 0;
      for (std::uint32_t c = 0; c < 3; ++c) texture.texels[texel][c] = static_cast<std::uint8_t>(word >> (8 * c));
    }
    if (step) step(static_cast<double>(tiles.size()) / static_cast<double>(order.size()));
  }
  fill_between(texture, std::move(known));
  return seen;
}

}  // namespace cairn
