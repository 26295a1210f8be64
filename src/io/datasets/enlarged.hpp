// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth images enlarged by nearest neighbor: blocks of equal pixels, each with a single measurement.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace cairn {

/// Depth changes between neighboring pixels, counted by column and row over images of one size.
class DepthChanges {
 public:
  /// Adds an image of CV_16UC1 or CV_32FC1; images of another size than the first are skipped. Values without a
  /// measurement (0, NaN, `invalid`) count as no change.
  void add(const cv::Mat& image, int invalid);

  struct Blocks {
    std::vector<int> columns, rows;  ///< first pixel of each block; empty: every pixel is a block
  };
  /// Returns the block grid of images enlarged in both directions by a factor of 1.2 or more. Each inner border of a
  /// block shows changes; other places in the images hardly do.
  [[nodiscard]] Blocks blocks() const;

 private:
  int width_ = 0, height_ = 0;
  std::vector<std::int64_t> columns_, rows_;  // counts, by the border before a pixel
};

}  // namespace cairn
