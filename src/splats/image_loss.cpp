// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/image_loss.hpp"

#include "shaders/splats.h"
#include "spirv/splat_loss_gradient.comp.h"
#include "spirv/splat_loss_maps.comp.h"
#include "spirv/splat_loss_rows.comp.h"
#include "spirv/splat_loss_structure.comp.h"
#include "spirv/splat_loss_sums.comp.h"

namespace cairn {

ImageLoss::ImageLoss(gpu::Device& device)
    : device_(device),
      rows_(device, "splat_loss_rows", splat_loss_rows_comp),
      structure_kernel_(device, "splat_loss_structure", splat_loss_structure_comp),
      maps_kernel_(device, "splat_loss_maps", splat_loss_maps_comp),
      gradient_(device, "splat_loss_gradient", splat_loss_gradient_comp),
      sums_kernel_(device, "splat_loss_sums", splat_loss_sums_comp) {}

void ImageLoss::compare(int width, int height, const gpu::Buffer& image, const gpu::Buffer& color,
                        const gpu::Buffer& depth, const Exposure& exposure, const LossWeights& weights) {
  const shader::SplatLossPush push{.width = static_cast<std::uint32_t>(width),
                                   .height = static_cast<std::uint32_t>(height),
                                   .gain = exposure.gain,
                                   .offset = exposure.offset,
                                   .structure = weights.structure,
                                   .depth = weights.depth,
                                   .opacity = weights.opacity};
  if (const std::uint64_t pixels = std::uint64_t{push.width} * push.height;
      pixels != pixels_ || push.height != height_) {
    device_.wait();
    pixels_ = pixels;
    height_ = push.height;
    constexpr std::uint64_t kChannels = 3;
    moments_ = gpu::Buffer(device_, 4 * kChannels * shader::kLossMoments * pixels);
    maps_ = gpu::Buffer(device_, 4 * kChannels * shader::kLossMaps * pixels);
    blurred_ = gpu::Buffer(device_, 4 * kChannels * shader::kLossMaps * pixels);
    structure_ = gpu::Buffer(device_, 4 * kChannels * pixels);
    gradients_ = gpu::Buffer(device_, 4 * shader::kSplatImages * pixels);
    sums_ = gpu::Buffer(device_, 4 * std::uint64_t{shader::kLossSums} * push.height);
  }
  gpu::Batch batch(device_);
  const std::uint32_t columns = (push.width + 3) / 4, rows = (push.height + 3) / 4;  // of four pixels
  rows_(batch, {columns, push.height, 3}, push, {&image, &color, &moments_});
  structure_kernel_(batch, {push.width, rows, 3}, push, {&moments_, &maps_, &structure_});
  maps_kernel_(batch, {columns, push.height, 3}, push, {&maps_, &blurred_});
  gradient_(batch, {push.width, rows, 1}, push, {&image, &color, &depth, &blurred_, &gradients_});
  sums_kernel_(batch, {push.height, 1, 1}, push, {&image, &color, &depth, &structure_, &gradients_, &sums_});
  batch.submit();
}

ImageError ImageLoss::error() {
  std::vector<float> sums(std::size_t{shader::kLossSums} * height_);
  gpu::Batch batch(device_);
  batch.download(sums_, sums);
  batch.run();
  Eigen::Matrix<double, 8, 1> total = Eigen::Matrix<double, 8, 1>::Zero();
  for (std::size_t row = 0; row < height_; ++row)
    total += Eigen::Map<const Eigen::Matrix<float, 8, 1>>(sums.data() + row * shader::kLossSums).cast<double>();
  const auto pixels = static_cast<double>(pixels_);
  return {.loss = total[0] / pixels,
          .squared = total[1] / (3 * pixels),
          .gradient = {.gain = total.segment<3>(2).cast<float>(), .offset = total.segment<3>(5).cast<float>()}};
}

}  // namespace cairn
