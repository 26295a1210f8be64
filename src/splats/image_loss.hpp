// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "gpu/kernel.hpp"
#include "shaders/splat_loss.h"

namespace cairn {

/// Exposure of an image: its colors are compared as gain * color + offset.
struct Exposure {
  Eigen::Vector3f gain = Eigen::Vector3f::Ones(), offset = Eigen::Vector3f::Zero();
};

/// Weights of the loss.
struct LossWeights {
  float structure = 0.2f;  // of D-SSIM; the rest is L1 (Kerbl et al. 2023, eq. 7)
  float depth = 0.1f;      // per meter, of the depth along z against the surface
  float opacity = 0.01f;   // of missing opacity in front of a surface
};

/// Loss of an image, and its gradient by the exposure.
struct ImageError {
  double loss = 0;
  double squared = 0;  // mean over pixels and channels, colors in 0..1
  Exposure gradient;
};

/// Loss of a rendered image against a photo: L1 and D-SSIM (Wang et al. 2004), depth and opacity.
class ImageLoss {
 public:
  explicit ImageLoss(gpu::Device& device);

  /// `image`: planes of SplatRasterizer::image. `color`: words of the photo; `depth`: of the surface, meters, 0: none.
  /// The gradients stay on the device until the next call.
  void compare(int width, int height, const gpu::Buffer& image, const gpu::Buffer& color, const gpu::Buffer& depth,
               const Exposure& exposure, const LossWeights& weights);
  [[nodiscard]] const gpu::Buffer& gradients() const { return gradients_; }  // planes as the image's
  /// Sums of the last comparison.
  [[nodiscard]] ImageError error();

 private:
  gpu::Device& device_;
  gpu::Kernel<shader::SplatLossPush> rows_, structure_kernel_, maps_kernel_, gradient_, sums_kernel_;
  std::uint64_t pixels_ = 0;
  std::uint32_t height_ = 0;
  gpu::Buffer moments_, maps_, structure_, blurred_, gradients_, sums_;
};

}  // namespace cairn
