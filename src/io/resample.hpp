// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Images of one camera as another one in the same place would have taken them.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "cairn/camera.hpp"

namespace cairn {

/// Turns the images of camera `from` into those of `seen_by`, which looks from the same place in the same direction:
/// each of its pixels shows what the image shows on its ray, and has no depth beyond it. Images whose pixels all move
/// by `negligible` pixels at most, and keep their size, stay as they are.
class Resampler {
 public:
  Resampler() = default;
  Resampler(const Camera& seen_by, const Camera& from, double negligible = 0);
  /// Whether images stay as they are.
  [[nodiscard]] bool is_identity() const { return places_.empty(); }
  /// Depth in meters; its inverse is interpolated on one surface, between two the nearest pixel is taken.
  [[nodiscard]] std::vector<float> depth(std::vector<float> image) const;
  /// Bytes R, G, B, A, interpolated.
  [[nodiscard]] std::vector<std::uint32_t> color(std::vector<std::uint32_t> image) const;
  /// Of the nearest pixel.
  [[nodiscard]] std::vector<std::uint8_t> confidence(std::vector<std::uint8_t> image) const;

 private:
  cv::Size from_;
  cv::Mat2f places_;  // pixels of `from`, x and y
};

}  // namespace cairn
