// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "gpu/kernel.hpp"
#include "shaders/splats.h"
#include "splats/radix_sort.hpp"
#include "splats/splat_model.hpp"

namespace cairn {

/// Pose of a view, and its smoothing.
struct SplatView {
  Camera camera;  // rectified; the lens and the readout are ignored
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  float low_pass = 0.3f;  // pixels^2, added to the 2D covariances (Kerbl et al. 2023: 0.3)
};

/// Image of splats, row-major.
struct SplatImage {
  std::vector<Eigen::Vector3f> color;  // R, G, B, premultiplied by the opacity, over black
  std::vector<float> opacity;          // 0 to 1
  std::vector<float> depth;            // meters along z, premultiplied by the opacity
};

/// Differentiable rasterizer (Kerbl et al. 2023, sections 4 to 6): images of splats and gradients of their parameters.
/// All sums have a fixed order, so that results are the same in each run on a device.
class SplatRasterizer {
 public:
  explicit SplatRasterizer(gpu::Device& device);

  /// Renders a view. The image and the lists of visible splats stay on the device until the next call. Throws
  /// std::runtime_error for more entries than max_entries().
  void forward(const SplatModel& model, const SplatView& view);
  /// Gradients of the last view's parameters. `pixels`: gradients of its image, in planes as image().
  void backward(const SplatModel& model, const gpu::Buffer& pixels);

  [[nodiscard]] const gpu::Buffer& image() const { return image_; }  // shader::kSplatImages planes
  [[nodiscard]] SplatImage download_image();

  [[nodiscard]] std::uint32_t visible() const { return visible_; }          // splats in the last view
  [[nodiscard]] std::uint32_t entries() const { return entries_; }          // of all its tiles
  [[nodiscard]] std::uint32_t max_entries() const;                          // limit of the device
  [[nodiscard]] const gpu::Buffer& order() const { return pairs_.values; }  // splat of each rank, nearest first
  /// By splat: its rank by depth in the last view; shader::kNoSplatRank if it is not visible.
  [[nodiscard]] const gpu::Buffer& ranks() const { return ranks_; }
  /// Gradients in the planes of the model, of visible splats only.
  [[nodiscard]] const gpu::Buffer& gradients() const { return gradients_; }
  [[nodiscard]] const gpu::Buffer& harmonic_gradients() const { return harmonic_gradients_; }
  /// By splat: sum over views of the length of its gradient in the image, per image size, and the number of views.
  [[nodiscard]] const gpu::Buffer& motion() const { return motion_; }
  /// Zeroes motion(), for a model of `count` splats.
  void reset_motion(std::uint32_t count);

 private:
  void reserve_splats(const SplatModel& model);
  void reserve_entries(std::uint32_t entries);
  [[nodiscard]] shader::SplatViewPush view_push(const SplatModel& model) const;
  [[nodiscard]] shader::SplatImagePush image_push() const;

  gpu::Device& device_;
  RadixSort sort_;
  gpu::Kernel<shader::SplatViewPush> project_, color_, gradient_;
  gpu::Kernel<shader::SplatListPush> count_, list_entries_, ranges_kernel_;
  gpu::Kernel<shader::SplatImagePush> forward_, backward_;
  SplatView view_;
  std::uint32_t capacity_ = 0, entry_capacity_ = 0;  // splats, entries
  std::uint32_t columns_ = 0, tiles_ = 0;            // of the last view
  std::uint32_t visible_ = 0, entries_ = 0;
  RadixSort::Pairs pairs_, scratch_;              // depth key and splat
  RadixSort::Pairs entry_pairs_, entry_scratch_;  // tile and slot
  gpu::Buffer projected_, ranks_, tiles_of_, offsets_, visible_count_, entry_count_;
  gpu::Buffer owners_, splats_, slot_shapes_, slot_colors_;  // by slot, by entry, gradients by slot
  gpu::Buffer ranges_, image_;
  gpu::Buffer gradients_, harmonic_gradients_, motion_;
};

}  // namespace cairn
