// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/velocity.hpp"
#include "cairn/frame.hpp"
#include "cairn/pose.hpp"

namespace cairn {

/// The cameras of a rig without their lenses and at a resolution that adjustment works at: images average out noise.
struct BundleCameras {
  explicit BundleCameras(const Rig& rig);
  Rig rig;
  Camera depth, colour;
  int colour_level = 0;
  /// Where in the camera's own image, in shares of its width and height, a pixel of `depth` was measured.
  [[nodiscard]] Eigen::Vector2f measured_at(int x, int y) const;
};

/// A pixel's place in an image.
[[nodiscard]] inline std::size_t at(const Camera& c, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x);
}

/// A keyframe as the adjustment sees it.
struct BundleView {
  std::vector<float> depth;              // metres, by pixel of the depth camera; 0: none, or an edge
  std::vector<Eigen::Vector3f> normals;  // towards the camera; zero: none
  std::vector<std::uint8_t> brightness;  // smoothed, by pixel of the colour camera; empty: the frame has no colour
  float farthest = 0;                    // metres, of what is measured
  CameraMotion motion;
  double colour_delay = 0;  // seconds from the depth image's moment to the colour image's
};

/// `frame` is of one moment: a shutter that is known to roll is undone.
[[nodiscard]] BundleView bundle_view(const BundleCameras& cameras, const Frame& frame, const CameraMotion& motion);

}  // namespace cairn
