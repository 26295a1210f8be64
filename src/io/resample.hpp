// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Resampling of images into another camera at the same position.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "cairn/mapping/camera.hpp"

namespace cairn {

/// Resamples images of camera `from` into camera `target` at the same pose: each target pixel shows the source image
/// along its ray, and has no depth outside the source image. Images are returned unchanged if every pixel moves by at
/// most `max_shift` pixels and the size is the same.
class Resampler {
 public:
  Resampler() = default;
  Resampler(const Camera& target, const Camera& from, double max_shift = 0);
  /// True if images are returned unchanged.
  [[nodiscard]] bool is_identity() const { return map_.empty(); }
  /// Resamples depth in meters: inverse depth is interpolated within a surface, and the nearest pixel is used across
  /// surfaces.
  [[nodiscard]] std::vector<float> depth(std::vector<float> image) const;
  /// Resamples color, bytes R, G, B, A, by interpolation.
  [[nodiscard]] std::vector<std::uint32_t> color(std::vector<std::uint32_t> image) const;
  /// Resamples confidence by nearest neighbor.
  [[nodiscard]] std::vector<std::uint8_t> confidence(std::vector<std::uint8_t> image) const;

 private:
  cv::Size from_;
  cv::Mat2f map_;  // x and y in `from`, pixels
};

}  // namespace cairn
