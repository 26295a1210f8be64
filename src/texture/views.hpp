// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "cairn/mapping/pose.hpp"
#include "geometry/color_view.hpp"
#include "preprocess/preprocess.hpp"
#include "texture/charts.hpp"
#include "texture/voxel_colors.hpp"
#include "volume/raycast.hpp"

namespace cairn {

/// A keyframe as a source of color.
struct TextureKeyframe {
  std::size_t image = 0;                                                // its key for GetImage
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();  // at the time of the depth image
  Vector6d velocity = Vector6d::Zero();                                 // of the camera, in its own frame: rad/s, m/s
  double color_delay = 0;                                               // seconds from the depth to the color image
};

/// Color difference of two keyframes: logarithm of the ratio of the colors of `a` and `b`, median over `count` common
/// points.
struct ExposurePair {
  std::size_t a = 0, b = 0;
  Eigen::Vector3d logarithms = Eigen::Vector3d::Zero();
  int count = 0;
};

/// Colors surfaces from keyframes. Images are loaded to the device on demand; the least recently used are replaced.
class TextureViews {
 public:
  using GetImage = std::function<Frame(std::size_t image)>;  // called from several threads concurrently
  /// `volume`: the map, which fills in missing depth of the keyframes. `memory`: approximate limit for images on the
  /// device, bytes.
  TextureViews(Volume& volume, const Rig& rig, const SurfaceOptions& options, std::vector<TextureKeyframe> keyframes,
               GetImage get_image, std::uint64_t memory);

  /// Estimates exposure gains from points visible in several keyframes; blend() then adjusts all keyframes to their
  /// mean. `step` is called after each keyframe. Returns true if any keyframe has color.
  bool compensate_exposure(const std::function<void()>& step = {});
  /// Estimates the pose and focal length of the color camera relative to the depth camera from points visible in
  /// several keyframes (register_color_camera()), for color that is not well registered to depth. Call
  /// compensate_exposure() first.
  void register_color();
  [[nodiscard]] const shader::ColorCamera& color_camera() const { return color_; }
  /// Color gain of each keyframe, by channel.
  [[nodiscard]] const std::vector<Eigen::Vector3f>& gains() const { return gains_; }

  /// Colors the texture of the atlas. Returns the number of points visible in a keyframe; all other points get the
  /// color of `unseen`, if given, else of the mesh's vertices. `step` is called after each batch with its share of the
  /// work.
  std::size_t blend(TextureAtlas& atlas, const VoxelColors* unseen = nullptr,
                    const std::function<void(double share)>& step = {});

  /// Discards the images on the device, since the volume now holds another part of the map.
  void discard_images();

  /// Texel size at which no detail of the keyframes is lost: meters, median over the points.
  [[nodiscard]] float texel_size(const Mesh& mesh) const;

  [[nodiscard]] std::size_t size() const { return keyframes_.size(); }

 private:
  struct OnDevice {
    std::size_t keyframe = 0;
    std::uint64_t last_use = 0;
    bool has_color = false;
    gpu::Buffer pixels, blurred;
  };
  struct SeenPoints {  // with their colors in the keyframe of origin
    std::vector<shader::Texel> points;
    std::vector<std::size_t> keyframe;  // keyframe of each point, ascending
  };
  struct Tile;  // of the atlas
  struct BlendBuffers;
  void load_images(std::span<const std::size_t> keyframes);
  [[nodiscard]] const OnDevice& on_device(std::size_t keyframe) const;
  [[nodiscard]] std::vector<shader::Texel> points_of(std::size_t keyframe, int columns, int rows);
  /// Colors of points in a keyframe on the device, `sharp` or low frequencies only: bytes R, G, B, 255; 0: not visible.
  [[nodiscard]] std::vector<std::uint32_t> sample(std::size_t keyframe, const std::vector<shader::Texel>& points,
                                                  const shader::ColorCamera& color, bool sharp);
  [[nodiscard]] std::vector<ExposurePair> compare_exposures(std::size_t keyframe, const SeenPoints& earlier);
  [[nodiscard]] static std::vector<Tile> in_morton_order(const TextureAtlas& atlas);
  /// Keyframes with the most visible tiles, at most as many as the device holds.
  [[nodiscard]] std::vector<std::size_t> keyframes_that_see(std::span<const Tile> tiles) const;
  /// Colors tiles into `tile_colors`: bytes R, G, B, and 255 if the point is visible in a keyframe.
  void blend_tiles(const TextureAtlas& atlas, std::span<const Tile> tiles, BlendBuffers& buffers);
  [[nodiscard]] shader::TextureView view_of(std::size_t keyframe) const;
  [[nodiscard]] bool may_see(std::size_t keyframe, const Eigen::Vector3f& point, const Eigen::Vector3f& normal) const;

  Volume& volume_;
  gpu::Device& device_;
  float max_depth_;
  Preprocessor preprocessor_;
  ColorView in_color_;
  Camera camera_;  // the color camera, undistorted
  Raycaster raycaster_;
  std::vector<TextureKeyframe> keyframes_;
  std::vector<Eigen::Isometry3f> camera_from_world_;
  std::vector<Eigen::Vector3f> gains_;
  shader::ColorCamera color_{{0, 0, 0}, {0, 0, 0}, 1};
  GetImage get_image_;
  std::size_t capacity_;
  std::uint64_t use_ = 0;
  std::vector<std::unique_ptr<OnDevice>> images_;
  std::vector<int> slot_;  // by keyframe: index in images_, or -1
  gpu::Kernel<shader::TexturePreparePush> prepare_, blur_;
  gpu::Kernel<shader::TextureBlendPush> select_, blend_;
  gpu::Kernel<shader::TextureSamplePush> sample_;
  gpu::Buffer sample_view_, sample_points_, sample_colors_;  // grow on demand
};

/// Least-squares gains that equalize pairs of keyframes, with a weak prior at 1 (similar to Brown & Lowe 2007).
[[nodiscard]] std::vector<Eigen::Vector3f> exposure_gains(std::size_t keyframes, std::span<const ExposurePair> pairs);

}  // namespace cairn
