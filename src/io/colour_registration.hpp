// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "io/camera_file.hpp"

namespace cairn {

/// Colour of a camera beside the depth camera, brought to the depth pixels: each takes the pixel that its point falls
/// on. What the depth camera alone sees past an edge takes the colour of the edge.
class ColourRegistration {
 public:
  ColourRegistration(const Camera& depth, const ColourCamera& colour);
  /// `depth` in metres; `image` of the colour camera's size. 0 beyond the image.
  [[nodiscard]] std::vector<std::uint32_t> operator()(std::span<const float> depth,
                                                      std::span<const std::uint32_t> image) const;

 private:
  ColourCamera colour_;
  std::vector<cv::Point2d> rays_;  // z = 1, of the depth pixels
};

}  // namespace cairn
