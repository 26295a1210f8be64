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
#include "volume/voxel_kernel.hpp"

namespace cairn {

/// A keyframe as a source of color.
struct TextureKeyframe {
  std::size_t image = 0;                                                // its key for GetImage
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();  // at the time of the depth image
  Vector6d velocity = Vector6d::Zero();                                 // of the camera, in its own frame: rad/s, m/s
  double color_delay = 0;                                               // seconds from the depth to the color image
};

/// Colors surfaces from keyframes. Images are loaded to the device on demand; the least recently used are replaced.
class TextureViews {
 public:
  using GetImage = std::function<Frame(std::size_t image)>;  // called from several threads concurrently
  /// `volume`: the map, which fills in missing depth of the keyframes. `memory`: approximate limit for images on the
  /// device, bytes.
  TextureViews(Volume& volume, const Rig& rig, const SurfaceOptions& options, std::vector<TextureKeyframe> keyframes,
               GetImage get_image, std::uint64_t memory);

  /// True if any keyframe has color.
  [[nodiscard]] bool has_color();

  /// Loads the images of all keyframes that see the mesh, if the device holds them. Needs the device alone.
  void preload(const Mesh& mesh);

  /// Colors the texture of the atlas. Returns the number of points visible in a keyframe; all other points get the
  /// color of `unseen`, if given, else of the mesh's vertices. `step` is called after each batch with its share of the
  /// work.
  std::size_t blend(TextureAtlas& atlas, const VoxelColors* unseen = nullptr,
                    const std::function<void(double share)>& step = {});

  /// Discards the images on the device, since the volume now holds another part of the map.
  void discard_images();

  /// Texel size by vertex at which no detail of the keyframes is lost, meters; infinite for unseen vertices.
  [[nodiscard]] std::vector<float> texel_sizes(const Mesh& mesh) const;

  [[nodiscard]] std::size_t size() const { return keyframes_.size(); }

 private:
  struct OnDevice {
    std::size_t keyframe = 0;
    std::uint64_t last_use = 0;
    bool has_color = false;
    gpu::Buffer pixels, blurred;
  };
  struct Tile;  // of the atlas
  struct BlendBuffers;
  void load_images(std::span<const std::size_t> keyframes);
  [[nodiscard]] const OnDevice& on_device(std::size_t keyframe) const;
  /// Adapts the exposure of a view to the colors of the map. `model`: its depth in this view, at half the size.
  void equalize(OnDevice& image, const Eigen::Isometry3d& pose, const gpu::Buffer& model);
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
  GetImage get_image_;
  std::size_t capacity_;
  std::uint64_t use_ = 0;
  std::vector<std::unique_ptr<OnDevice>> images_;
  std::vector<int> slot_;  // by keyframe: index in images_, or -1
  gpu::Kernel<shader::TexturePreparePush> prepare_, blur_;
  VoxelKernel<shader::TextureReferencePush> reference_;
  gpu::Kernel<shader::TextureExposePush> expose_;
  gpu::Kernel<shader::TextureBlendPush> select_, blend_;
  gpu::Buffer map_colors_, gains_;
};

/// Gains that adapt the exposure and white balance of an image to the colors of the map: one per cell of the image, row
/// by row, and channel. The map holds the mean of all frames, so that views of different exposure agree, and the
/// texture has the exposure of its surroundings. `colors`, `map`: images of low frequencies, bytes R, G, B; alpha 0 in
/// `map`: unknown. A cell without comparable pixels has the mean gain of the image.
[[nodiscard]] std::vector<shader::vec3> exposure_gains(const std::vector<std::uint32_t>& colors,
                                                       const std::vector<std::uint32_t>& map, std::size_t columns);

}  // namespace cairn
