// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Against an exact scene: a flat wall with a pattern, and boards before the wall.
#include "texture/views.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "support/meshes.hpp"
#include "support/scenes.hpp"
#include "volume/volume.hpp"

namespace cairn {
namespace {

/// Color of the wall z = 2 at a point; smooth, so that its pixels sample it accurately.
Eigen::Vector3f wall(float x, float y) {
  return {128 + 80 * std::sin(7 * x), 128 + 80 * std::sin(9 * y + 1), 128 + 60 * std::cos(6 * (x + y))};
}

std::uint32_t word(const Eigen::Vector3f& c, float exposure) {
  std::uint32_t w = 0xff000000u;
  for (int k = 0; k < 3; ++k)
    w |= static_cast<std::uint32_t>(std::lround(std::clamp(exposure * c[k], 0.0f, 255.0f))) << (8 * k);
  return w;
}

/// View of a camera at (x, 0, 0) along z; `board`: columns of the image covered by a red board at 1 m.
Frame view_at(float x, float exposure, int board_from = 0, int board_to = 0) {
  const Camera camera = small_camera();
  Frame frame;
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3f ray = camera.ray(u, v).cast<float>();
      const bool is_board = u >= board_from && u < board_to;
      frame.depth.push_back(is_board ? 1.0f : 2.0f);
      frame.color.push_back(is_board ? 0xff0000ffu : word(wall(x + 2 * ray.x(), 2 * ray.y()), exposure));
    }
  return frame;
}

/// Map of the wall with its colors.
BrickTree wall_map() {
  constexpr float kVoxel = 0.01f, kTruncation = 0.04f;
  BrickTree tree;
  for (int x = -16; x < 16; ++x)
    for (int y = -16; y < 16; ++y)
      for (int z = 24; z <= 25; ++z) {
        BrickVoxels voxels{};
        for (int i = 0; i < 512; ++i) {
          const Eigen::Vector3f at =
              kVoxel * Eigen::Vector3f(static_cast<float>(8 * x + (i >> 6)), static_cast<float>(8 * y + (i >> 3 & 7)),
                                       static_cast<float>(8 * z + (i & 7)));
          const float distance = std::clamp((2.0f - at.z()) / kTruncation, -1.0f, 1.0f);
          voxels[static_cast<std::size_t>(i)] =
              shader::pack_voxel(distance, 1) | std::uint64_t{word(wall(at.x(), at.y()), 1)} << 32;
        }
        tree.put({x, y, z}, voxels);
      }
  return tree;
}

struct WallScene {
  Volume volume{test_device(), {.device_memory = 96 << 20}, 5};
  std::vector<Frame> frames;
  std::vector<TextureKeyframe> keyframes;
  TextureAtlas atlas;

  void add(Frame frame, float x) {
    TextureKeyframe k{.image = frames.size()};
    k.world_from_camera.translation().x() = static_cast<double>(x);
    keyframes.push_back(k);
    frames.push_back(std::move(frame));
  }
  [[nodiscard]] TextureViews views() {
    return {volume, small_camera(), SurfaceOptions{}, keyframes, [&](std::size_t i) { return frames[i]; }, 64 << 20};
  }
  /// Makes an atlas of the wall's middle, facing the cameras, with black vertex colors.
  void make_atlas() {
    Mesh mesh = grid_mesh(20, 20, 0.04f, [](float x, float y) { return Eigen::Vector3f(x - 0.4f, 0.4f - y, 2); });
    for (auto& n : mesh.normals) n = {0, 0, -1};
    mesh.colors.assign(mesh.positions.size(), {0, 0, 0, 255});
    atlas = *pack(mesh, make_charts(mesh, std::vector(mesh.positions.size(), 0.01f), 512), 512);
  }
  /// Calls `with` a point of the wall and its color in the atlas.
  void each_texel(const std::function<void(const Eigen::Vector3f&, const std::array<std::uint8_t, 3>&)>& with) const {
    for (const TextureAtlas::Tile& tile : atlas.tiles)
      for (std::size_t k = 0; k < shader::kTileTexels; ++k)
        if (const shader::Texel point = atlas.point(tile, k); point.normal != 0)
          with(Eigen::Vector3f(point.position), atlas.mesh.texture.texels[atlas.texel(tile, k)]);
  }
  /// Root mean square and largest difference to the wall times an exposure.
  [[nodiscard]] std::pair<double, double> error(float exposure) const {
    double squared = 0, max_error = 0, count = 0;
    each_texel([&](const Eigen::Vector3f& p, const std::array<std::uint8_t, 3>& t) {
      const Eigen::Vector3f c = exposure * wall(p.x(), p.y());
      for (int k = 0; k < 3; ++k) {
        const double d = static_cast<double>(t[static_cast<std::size_t>(k)]) - static_cast<double>(c[k]);
        squared += d * d;
        max_error = std::max(max_error, std::abs(d));
        ++count;
      }
    });
    return {std::sqrt(squared / count), max_error};
  }
};

TEST(TextureViews, ReproduceTheSeenColors) {
  WallScene s;
  for (const float x : {-0.2f, 0.0f, 0.25f}) s.add(view_at(x, 1), x);
  s.make_atlas();
  TextureViews views = s.views();
  const std::size_t seen = views.blend(s.atlas);
  std::size_t points = 0;
  s.each_texel([&](auto&&...) { ++points; });
  EXPECT_EQ(seen, points);
  const auto [rms, max_error] = s.error(1);
  EXPECT_LT(rms, 1.5);
  EXPECT_LT(max_error, 6);
}

TEST(TextureViews, RespectOcclusion) {
  WallScene s;
  s.add(view_at(0.0f, 1, 100, 200), 0);  // covers the middle
  s.add(view_at(0.3f, 1, 10, 40), 0.3f);
  s.make_atlas();
  TextureViews views = s.views();
  views.blend(s.atlas);
  s.each_texel([](const Eigen::Vector3f&, const std::array<std::uint8_t, 3>& t) {
    ASSERT_FALSE(t[0] > 240 && t[1] < 30 && t[2] < 30) << "the board's color is on the wall";
  });
  EXPECT_LT(s.error(1).first, 2);
}

TEST(TextureViews, RejectTheOutlierOfOneView) {
  // A person was in front of the wall once: four views agree, one shows red at the wall's own depth.
  WallScene s;
  for (const float x : {-0.2f, -0.1f, 0.1f, 0.2f}) s.add(view_at(x, 1), x);
  Frame odd = view_at(0, 1, 120, 180);
  odd.depth.assign(odd.depth.size(), 2.0f);
  s.add(odd, 0);
  s.make_atlas();
  TextureViews views = s.views();
  views.blend(s.atlas);
  EXPECT_LT(s.error(1).first, 4);
}

TEST(TextureViews, AdaptExposuresToTheMap) {
  WallScene s;
  const std::array<float, 5> exposures{0.6f, 0.7f, 0.8f, 0.9f, 1.0f};
  for (std::size_t i = 0; i < exposures.size(); ++i) {
    const float x = 0.15f * (static_cast<float>(i) - 2);
    s.add(view_at(x, exposures[i]), x);
  }
  s.make_atlas();
  s.views().blend(s.atlas);
  const double without = s.error(1).first;
  s.volume.adopt(wall_map());
  TextureViews views = s.views();
  EXPECT_TRUE(views.has_color());
  views.blend(s.atlas);
  EXPECT_LT(s.error(1).first, 4);
  EXPECT_GT(without, 6);
}

TEST(TextureViews, UseTheMapWithoutMeasuredDepth) {
  WallScene s;
  Frame blind = view_at(0, 1);
  blind.depth.assign(blind.depth.size(), 0.0f);
  s.add(blind, 0);
  s.make_atlas();
  EXPECT_EQ(s.views().blend(s.atlas), 0u);  // an empty map has no visible texel
  s.volume.adopt(wall_map());
  EXPECT_GT(s.views().blend(s.atlas), 1000u);
  EXPECT_LT(s.error(1).first, 3);
}

TEST(TextureViews, CompensateTheColorDelay) {
  // The camera moves to the right at 1 m/s, and its color images are 20 ms later than the depth images.
  WallScene s;
  for (const float x : {-0.1f, 0.1f}) {
    s.add(view_at(x + 0.02f, 1), x);
    s.keyframes.back().velocity << 0, 0, 0, 1, 0, 0;
    s.keyframes.back().color_delay = 0.02;
  }
  s.make_atlas();
  TextureViews views = s.views();
  views.blend(s.atlas);
  EXPECT_LT(s.error(1).first, 1.5);
}

TEST(TextureViews, RespectTheMemoryLimit) {
  WallScene s;
  for (int i = 0; i < 40; ++i) s.add(view_at(0.01f * static_cast<float>(i), 1), 0.01f * static_cast<float>(i));
  s.make_atlas();
  const std::uint64_t before = test_device().memory_in_use();
  TextureViews views(
      s.volume, small_camera(), SurfaceOptions{}, s.keyframes, [&](std::size_t i) { return s.frames[i]; }, 1 << 20);
  views.blend(s.atlas);
  EXPECT_LT(test_device().memory_in_use() - before, 40u << 20);
  EXPECT_LT(s.error(1).first, 2);
}

TEST(TextureViews, UseVoxelColorsForUnseenSurface) {
  WallScene s;
  s.add(view_at(5, 1), 5);  // does not see the wall
  s.make_atlas();
  Mesh fine = grid_mesh(250, 250, 0.004f, [](float x, float y) { return Eigen::Vector3f(x - 0.5f, 0.5f - y, 2); });
  for (const auto& p : fine.positions) {
    const Eigen::Vector3f c = wall(p.x(), p.y());
    fine.colors.push_back(
        {static_cast<std::uint8_t>(c.x()), static_cast<std::uint8_t>(c.y()), static_cast<std::uint8_t>(c.z()), 255});
  }
  const VoxelColors colors(fine, 0.01f);
  EXPECT_EQ(s.views().blend(s.atlas, &colors), 0u);
  EXPECT_LT(s.error(1).first, 3);
  EXPECT_EQ(colors.at({9, 9, 9}, 0x123456), 0x123456u);
}

/// Image of one color.
std::vector<std::uint32_t> plain(std::uint32_t color) {
  return std::vector<std::uint32_t>(80 * std::size_t{60}, color);
}

TEST(ExposureGains, AreOneWithoutColorInTheMap) {
  for (const shader::vec3& gain : exposure_gains(plain(0xff808080u), plain(0), 80))
    EXPECT_EQ(Eigen::Vector3f(gain), Eigen::Vector3f(Eigen::Vector3f::Ones()));
}

TEST(ExposureGains, OfAnImageHoldWhereTheMapIsUnknown) {
  // Red is twice as bright in the map, which covers the upper half of the image.
  std::vector<std::uint32_t> map = plain(0xff8080a0u);
  std::fill(map.begin() + static_cast<std::ptrdiff_t>(map.size() / 2), map.end(), 0u);
  for (const shader::vec3& gain : exposure_gains(plain(0xff808050u), map, 80)) {
    EXPECT_NEAR(gain.x, 2, 1e-3f);
    EXPECT_NEAR(gain.y, 1, 1e-3f);
  }
}

TEST(ExposureGains, IgnoreOverexposedPixels) {
  for (const shader::vec3& gain : exposure_gains(plain(0xffffffffu), plain(0xff808080u), 80)) EXPECT_EQ(gain.x, 1);
}

TEST(PackNormal, ComesBackOnTheHost) {
  for (const Eigen::Vector3f& n : {Eigen::Vector3f(0, 0, 1), Eigen::Vector3f(0, 0, -1), Eigen::Vector3f(1, 2, -3),
                                   Eigen::Vector3f(-0.5f, 0.2f, 0.1f), Eigen::Vector3f(-1, -1, -1)})
    EXPECT_LT((shader::unpack_normal(shader::pack_normal(n)) - n.normalized()).norm(), 1e-4f) << n.transpose();
}

}  // namespace
}  // namespace cairn
