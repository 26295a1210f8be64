// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "base/colour_view.hpp"
#include "cairn/pose.hpp"
#include "surface/preprocess.hpp"
#include "texture/charts.hpp"
#include "texture/voxel_colours.hpp"
#include "volume/raycast.hpp"

namespace cairn {

/// A keyframe that may give colour.
struct TextureKeyframe {
  std::size_t image = 0;  // what it is called with by the function that gives images
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();  // when the depth image was taken
  Vector6d velocity = Vector6d::Zero();                                 // of the camera, in its own frame: rad/s, m/s
  double colour_delay = 0;                                              // seconds from the depth to the colour image
};

/// How the colours of two keyframes differ: logarithms of the colour of `a` over that of `b`, the median of `count`
/// points that both see.
struct ExposurePair {
  std::size_t a = 0, b = 0;
  Eigen::Vector3d logarithms = Eigen::Vector3d::Zero();
  int count = 0;
};

/// Colours surfaces from keyframes. Their images come to the device when they are needed and leave it when others need
/// the place.
class TextureViews {
 public:
  using GetImage = std::function<Frame(std::size_t image)>;  // from several threads at once
  /// `volume`: the map, which tells what a keyframe can see where it measured nothing. `memory`: bytes of images on the
  /// device, about.
  TextureViews(Volume& volume, const Rig& rig, const SurfaceOptions& options, std::vector<TextureKeyframe> keyframes,
               GetImage get_image, std::uint64_t memory);

  /// Finds by how much the keyframes' exposures differ where they see the same, so that blend() takes them to their
  /// mean. `step` is called after each keyframe. Returns whether any has colour.
  bool compensate_exposure(const std::function<void()>& step = {});
  /// Finds how the colour camera lies to the depth camera, where colour is not on depth as it should be, from what
  /// several keyframes see (register_colour_camera()). Wants compensate_exposure() before it.
  void register_colour();
  [[nodiscard]] const shader::ColourCamera& colour_camera() const { return colour_; }
  /// What each keyframe's colours are multiplied with, by channel.
  [[nodiscard]] const std::vector<Eigen::Vector3f>& gains() const { return gains_; }

  /// Colours the atlas' texture. Returns how many of its points a keyframe sees; others get the colour of `unseen`, if
  /// there is one, else of the mesh's own vertices. `step` is called after each share of the work.
  std::size_t blend(TextureAtlas& atlas, const VoxelColours* unseen = nullptr,
                    const std::function<void(double share)>& step = {});

  /// The map is another part of itself from now on: images that were compared with it are brought anew.
  void forget();

  /// A texel's size that shows all that the keyframes see of the points: metres, the median over the points.
  [[nodiscard]] float texel_size(const Mesh& mesh) const;

  [[nodiscard]] std::size_t size() const { return keyframes_.size(); }

 private:
  struct OnDevice {
    std::size_t keyframe = 0;
    std::uint64_t last_use = 0;
    bool has_colour = false;
    gpu::Buffer pixels, blurred;
  };
  struct SeenPoints {  // with the colours in which the keyframes that they come from see them
    std::vector<shader::Texel> points;
    std::vector<std::size_t> keyframe;  // of each, in order
  };
  struct Tile;  // of the atlas
  struct BlendBuffers;
  void bring(std::span<const std::size_t> keyframes);
  [[nodiscard]] const OnDevice& on_device(std::size_t keyframe) const;
  [[nodiscard]] std::vector<shader::Texel> points_of(std::size_t keyframe, int columns, int rows);
  /// What a keyframe on the device sees at some points, `sharp` or its low frequencies: bytes R, G, B, 255; 0: not
  /// seen.
  [[nodiscard]] std::vector<std::uint32_t> sample(std::size_t keyframe, const std::vector<shader::Texel>& points,
                                                  const shader::ColourCamera& colour, bool sharp);
  [[nodiscard]] std::vector<ExposurePair> compare_exposures(std::size_t keyframe, const SeenPoints& earlier);
  [[nodiscard]] static std::vector<Tile> in_morton_order(const TextureAtlas& atlas);
  /// Those that see most of some tiles, no more than the device holds.
  [[nodiscard]] std::vector<std::size_t> keyframes_that_see(std::span<const Tile> tiles) const;
  /// Colours tiles in `tile_colours`: bytes R, G, B, and 255 where a keyframe sees the point.
  void blend_tiles(const TextureAtlas& atlas, std::span<const Tile> tiles, BlendBuffers& buffers);
  [[nodiscard]] shader::TextureView view_of(std::size_t keyframe) const;
  [[nodiscard]] bool may_see(std::size_t keyframe, const Eigen::Vector3f& point, const Eigen::Vector3f& normal) const;

  Volume& volume_;
  gpu::Device& device_;
  float max_depth_;
  Preprocessor preprocessor_;
  ColourView in_colour_;
  Camera camera_;  // the one that gives colour, without distortion
  Raycaster raycaster_;
  std::vector<TextureKeyframe> keyframes_;
  std::vector<Eigen::Isometry3f> camera_from_world_;
  std::vector<Eigen::Vector3f> gains_;
  shader::ColourCamera colour_{{0, 0, 0}, {0, 0, 0}, 1};
  GetImage get_image_;
  std::size_t capacity_;
  std::uint64_t use_ = 0;
  std::vector<std::unique_ptr<OnDevice>> images_;
  std::vector<int> slot_;  // by keyframe: in images_, or -1
  gpu::Kernel<shader::TexturePreparePush> prepare_, blur_;
  gpu::Kernel<shader::TextureBlendPush> select_, blend_;
  gpu::Kernel<shader::TextureSamplePush> sample_;
  gpu::Buffer sample_view_, sample_points_, sample_colours_;  // grow with what is asked for
};

/// Gains that bring pairs of keyframes together in the mean square, with a little pull to 1 (as Brown & Lowe 2007).
[[nodiscard]] std::vector<Eigen::Vector3f> exposure_gains(std::size_t keyframes, std::span<const ExposurePair> pairs);

}  // namespace cairn
