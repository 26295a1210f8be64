// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/pose.hpp"
#include "geometry/velocity.hpp"

namespace cairn {

/// Cameras of a rig without distortion, at the resolution of the adjustment: reduced images average out noise.
struct BundleCameras {
  explicit BundleCameras(const Rig& rig);
  Rig rig;
  Camera depth, color;
  int color_level = 0;
  /// Position of a pixel of `depth` in the camera's own image, as shares of its width and height.
  [[nodiscard]] Eigen::Vector2f measured_at(int x, int y) const;
};

/// Index of a pixel in an image.
[[nodiscard]] inline std::size_t at(const Camera& c, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x);
}

/// Preprocessed keyframe of the adjustment.
struct BundleView {
  std::vector<float> depth;              // meters, by pixel of the depth camera; 0: none, or an edge
  std::vector<Eigen::Vector3f> normals;  // towards the camera; zero: none
  std::vector<std::uint8_t> brightness;  // smoothed, by pixel of the color camera; empty: the frame has no color
  float farthest = 0;                    // maximum of depth, meters
  CameraMotion motion;
  double color_delay = 0;  // s from the depth image's time to the color image's
};

/// Preprocesses a keyframe. `frame` is of one moment, with a known rolling shutter already corrected.
[[nodiscard]] BundleView bundle_view(const BundleCameras& cameras, const Frame& frame, const CameraMotion& motion);

}  // namespace cairn
