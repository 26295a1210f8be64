// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth images that were enlarged by nearest neighbor: blocks of equal pixels, which carry no more than one
// measurement.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace cairn {

/// Changes of depth from pixel to pixel, counted by column and row over images of one size.
class DepthChanges {
 public:
  /// An image of CV_16UC1 or CV_32FC1; one of another size than the first is passed over. Values that are no
  /// measurement (0, NaN, `invalid`) change nothing.
  void add(const cv::Mat& image, int invalid);

  struct Blocks {
    std::vector<int> columns, rows;  ///< first pixel of each block; empty: each pixel is its own
  };
  /// The grid of blocks of one image enlarged in both directions, to at least 1.2 times its size. Each inner border of
  /// a block shows changes, and hardly any other place in the images does.
  [[nodiscard]] Blocks blocks() const;

 private:
  int width_ = 0, height_ = 0;
  std::vector<std::int64_t> columns_, rows_;  // by border before a pixel
};

}  // namespace cairn
