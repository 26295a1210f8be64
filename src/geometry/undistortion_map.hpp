// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <opencv2/core.hpp>

#include "cairn/mapping/camera.hpp"

namespace cairn {

/// Pixels of a lens' image by pixel of a pinhole camera of the same pose, CV_32FC2, for cv::remap.
[[nodiscard]] inline cv::Mat undistortion_map(const Camera& lens, const Camera& pinhole) {
  cv::Mat map(pinhole.height, pinhole.width, CV_32FC2);
  for (int y = 0; y < pinhole.height; ++y)
    for (int x = 0; x < pinhole.width; ++x) {
      const Eigen::Vector2d distorted = lens.distort(pinhole.ray(x, y).head<2>());
      map.at<cv::Vec2f>(y, x) = {static_cast<float>(lens.fx * distorted.x() + lens.cx),
                                 static_cast<float>(lens.fy * distorted.y() + lens.cy)};
    }
  return map;
}

}  // namespace cairn
