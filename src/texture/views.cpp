// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "texture/views.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "spirv/texture_blend.comp.h"
#include "spirv/texture_blur.comp.h"
#include "spirv/texture_prepare.comp.h"
#include "spirv/texture_sample.comp.h"
#include "spirv/texture_select.comp.h"
#include "texture/color_registration.hpp"

namespace cairn {
namespace {

constexpr float kDepthTolerance = 0.02f;   // meters in addition to the noise, maximum distance between the surface and
                                           // a keyframe's depth
constexpr std::size_t kBatchTiles = 4096;  // colored per dispatch
constexpr int kGridX = 12, kGridY = 9;     // sample points per keyframe for exposure comparison
constexpr std::size_t kMinCommonPoints = 8;  // minimum number of common points of two keyframes
constexpr double kPriorWeight = 0.02;  // weight of the prior that pulls gains to 1, relative to the mean weight of
                                       // pairs
constexpr double kMaxGain = 1.0;       // limit of the logarithm
constexpr int kMinColor = 12;          // of 255; darker colors carry no information about exposure

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

/// `differences`: logarithms of the ratio of the colors of `a` and `b`, by channel. Returns no value if there are too
/// few.
std::optional<ExposurePair> exposure_pair(std::size_t a, std::size_t b,
                                          std::array<std::vector<double>, 3>& differences) {
  ExposurePair pair{.a = a, .b = b};
  for (std::size_t c = 0; c < 3; ++c) {
    auto& d = differences[c];
    if (d.size() < kMinCommonPoints) return std::nullopt;
    const auto middle = d.begin() + static_cast<std::ptrdiff_t>(d.size() / 2);
    std::nth_element(d.begin(), middle, d.end());
    pair.logarithms[static_cast<int>(c)] = *middle;
    pair.count = static_cast<int>(d.size());
  }
  return pair;
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
      gains_(keyframes_.size(), Eigen::Vector3f::Ones()),
      get_image_(std::move(get_image)),
      capacity_(std::max<std::size_t>(16, memory / (pixels_of(camera_) * 8 + pixels_of(camera_) / 4))),
      slot_(keyframes_.size(), -1),
      prepare_(device_, "texture_prepare", texture_prepare_comp, shader::constants_of(rig.sensor)),
      blur_(device_, "texture_blur", texture_blur_comp),
      select_(device_, "texture_select", texture_select_comp, shader::constants_of(rig.sensor)),
      blend_(device_, "texture_blend", texture_blend_comp, shader::constants_of(rig.sensor)),
      sample_(device_, "texture_sample", texture_sample_comp, shader::constants_of(rig.sensor)),
      sample_view_(device_, sizeof(shader::TextureView)) {
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
    }
  }
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
          .gain = gains_[keyframe],
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

float TextureViews::texel_size(const Mesh& mesh) const {
  constexpr std::size_t kSamples = 2000;
  std::vector<float> sizes;
  const std::size_t step = std::max<std::size_t>(1, mesh.positions.size() / kSamples);
  for (std::size_t v = 0; v < mesh.positions.size(); v += step) {
    float best = std::numeric_limits<float>::max();
    for (std::size_t k = 0; k < keyframes_.size(); ++k)
      if (may_see(k, mesh.positions[v], mesh.normals[v]))
        best = std::min(best, (camera_from_world_[k] * mesh.positions[v]).z() / static_cast<float>(camera_.fx));
    if (best < std::numeric_limits<float>::max()) sizes.push_back(best);
  }
  if (sizes.empty()) return 0;
  std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2), sizes.end());
  return sizes[sizes.size() / 2];
}

/// Measured points of a keyframe on a grid of its image, with normals towards the camera.
std::vector<shader::Texel> TextureViews::points_of(std::size_t keyframe, int columns, int rows) {
  std::vector<shader::uvec2> pixels(pixels_of(camera_));
  gpu::Batch batch(device_);
  batch.download(on_device(keyframe).pixels, pixels);
  batch.run();
  std::vector<shader::Texel> points;
  const Eigen::Isometry3d& pose = keyframes_[keyframe].world_from_camera;
  for (int gy = 0; gy < rows; ++gy)
    for (int gx = 0; gx < columns; ++gx) {
      const int x = (2 * gx + 1) * camera_.width / (2 * columns), y = (2 * gy + 1) * camera_.height / (2 * rows);
      const auto z = std::bit_cast<Eigen::half>(
          static_cast<std::uint16_t>(pixels[static_cast<std::size_t>(y * camera_.width + x)].x));
      if (z == Eigen::half(0)) continue;
      const Eigen::Vector3d p = pose * (static_cast<double>(static_cast<float>(z)) * camera_.ray(x, y));
      points.push_back({Eigen::Vector3f(p.cast<float>()),
                        shader::pack_normal((pose.translation() - p).normalized().cast<float>()), 0});
    }
  return points;
}

std::vector<std::uint32_t> TextureViews::sample(std::size_t keyframe, const std::vector<shader::Texel>& points,
                                                const shader::ColorCamera& color, bool sharp) {
  std::vector<std::uint32_t> colors(points.size());
  if (points.empty()) return colors;
  if (!sample_points_ || sample_points_.size() < points.size() * sizeof(shader::Texel)) {
    sample_points_ = gpu::Buffer(device_, 2 * points.size() * sizeof(shader::Texel));
    sample_colors_ = gpu::Buffer(device_, 2 * points.size() * 4);
  }
  const auto count = static_cast<std::uint32_t>(points.size());
  const shader::TextureView view = view_of(keyframe);
  gpu::Batch batch(device_);
  batch.upload(sample_view_, std::span(&view, 1));
  batch.upload(sample_points_, points);
  sample_(batch, {count, 1, 1},
          {.camera = shader::pinhole(camera_),
           .color = color,
           .points = count,
           .tolerance = kDepthTolerance,
           .sharp = sharp},
          {&sample_points_, &sample_view_, &sample_colors_});
  batch.download(sample_colors_, colors);
  batch.run();
  return colors;
}

void TextureViews::register_color() {
  constexpr std::size_t kGroups = 8, kGroupSize = 5;  // groups of consecutive keyframes, spread over the trajectory
  constexpr int kColumns = 24, kRows = 18;            // sample points per keyframe
  std::vector<std::size_t> chosen;
  const std::size_t group = std::max(keyframes_.size() / kGroups, kGroupSize);
  for (std::size_t k = 0; k < keyframes_.size() && chosen.size() < capacity_; ++k) {
    if (k % group >= kGroupSize) continue;
    load_images(std::array{k});
    if (on_device(k).has_color) chosen.push_back(k);
  }
  // Points of the chosen keyframes, with all keyframes in which each may be visible.
  std::vector<shader::Texel> points;
  for (const std::size_t k : chosen)
    for (const shader::Texel& p : points_of(k, kColumns, kRows)) points.push_back(p);
  ColorObservations observations{.points = points.size(), .point = {}, .brightness = {}};
  std::vector<std::pair<std::size_t, std::vector<shader::Texel>>> sampled;  // by keyframe, in the order of the
                                                                            // observations
  for (const std::size_t k : chosen) {
    auto& list = sampled.emplace_back(k, std::vector<shader::Texel>{}).second;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!may_see(k, points[i].position, shader::unpack_normal(points[i].normal))) continue;
      observations.point.push_back(i);
      list.push_back(points[i]);
    }
  }
  observations.brightness = [&](const shader::ColorCamera& color, bool sharp) {
    std::vector<float> brightness;
    brightness.reserve(observations.point.size());
    for (const auto& [k, list] : sampled)
      for (const std::uint32_t word : sample(k, list, color, sharp))
        brightness.push_back(
            word == 0 ? -1.0f : static_cast<float>((word & 255) + (word >> 8 & 255) + (word >> 16 & 255)) / 765);
    return brightness;
  };
  if (const auto camera = register_color_camera(observations)) color_ = *camera;
}

std::vector<ExposurePair> TextureViews::compare_exposures(std::size_t keyframe, const SeenPoints& earlier) {
  // Samples only points possibly in view.
  SeenPoints nearby;
  for (std::size_t i = 0; i < earlier.points.size(); ++i) {
    const std::size_t other = earlier.keyframe[i];
    const Eigen::Vector3f p = earlier.points[i].position;
    if (!may_see(keyframe, p, (keyframes_[other].world_from_camera.translation().cast<float>() - p).normalized()))
      continue;
    nearby.points.push_back(earlier.points[i]);
    nearby.keyframe.push_back(other);
  }
  const std::vector<std::uint32_t> colors = sample(keyframe, nearby.points, color_, false);
  std::vector<ExposurePair> pairs;
  std::array<std::vector<double>, 3> differences;
  for (std::size_t i = 0; i < nearby.points.size();) {
    const std::size_t other = nearby.keyframe[i];
    for (auto& d : differences) d.clear();
    for (; i < nearby.points.size() && nearby.keyframe[i] == other; ++i) {
      if (colors[i] == 0) continue;
      for (std::uint32_t c = 0; c < 3; ++c) {
        const auto a = static_cast<int>(nearby.points[i].color >> (8 * c) & 255),
                   b = static_cast<int>(colors[i] >> (8 * c) & 255);
        if (std::min(a, b) >= kMinColor && std::max(a, b) < 250)
          differences[c].push_back(std::log(static_cast<double>(a) / b));
      }
    }
    if (const auto pair = exposure_pair(other, keyframe, differences)) pairs.push_back(*pair);
  }
  return pairs;
}

bool TextureViews::compensate_exposure(const std::function<void()>& step) {
  SeenPoints points;  // points of all keyframes so far
  std::vector<ExposurePair> pairs;
  bool any_color = false;
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    load_images(std::array{k});
    if (on_device(k).has_color) {
      any_color = true;
      for (const ExposurePair& pair : compare_exposures(k, points)) pairs.push_back(pair);
      // Adds the keyframe's own points with low-frequency colors, like those sampled from other keyframes.
      std::vector<shader::Texel> own = points_of(k, kGridX, kGridY);
      const std::vector<std::uint32_t> own_colors = sample(k, own, color_, false);
      for (std::size_t i = 0; i < own.size(); ++i) {
        if (own_colors[i] == 0) continue;
        own[i].color = own_colors[i];
        points.points.push_back(own[i]);
        points.keyframe.push_back(k);
      }
    }
    if (step) step();
  }
  gains_ = exposure_gains(keyframes_.size(), pairs);
  return any_color;
}

std::vector<Eigen::Vector3f> exposure_gains(std::size_t keyframes, std::span<const ExposurePair> pairs) {
  std::vector<Eigen::Vector3f> gains(keyframes, Eigen::Vector3f::Ones());
  if (pairs.empty()) return gains;
  // For each channel, minimizes the sum over pairs of count (log gain_a - log gain_b + log a / b)^2.
  const auto n = static_cast<int>(keyframes);
  double mean = 0;
  for (const ExposurePair& pair : pairs) mean += 2.0 * pair.count / static_cast<double>(keyframes);
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixX3d right = Eigen::MatrixX3d::Zero(n, 3);
  for (const ExposurePair& pair : pairs) {
    const auto a = static_cast<int>(pair.a), b = static_cast<int>(pair.b);
    const double w = pair.count;
    entries.insert(entries.end(), {{a, a, w}, {b, b, w}, {a, b, -w}, {b, a, -w}});
    right.row(a) -= w * pair.logarithms.transpose();
    right.row(b) += w * pair.logarithms.transpose();
  }
  for (int k = 0; k < n; ++k) entries.emplace_back(k, k, kPriorWeight * mean);
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::MatrixX3d logarithms = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(right);
  for (int k = 0; k < n; ++k)
    for (int c = 0; c < 3; ++c)
      gains[static_cast<std::size_t>(k)][c] =
          static_cast<float>(std::exp(std::clamp(logarithms(k, c), -kMaxGain, kMaxGain)));
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
                                      .color = color_,
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
