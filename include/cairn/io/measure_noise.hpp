// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <algorithm>
#include <optional>
#include <vector>

#include "cairn/mapping/camera.hpp"
#include "cairn/mapping/sensor_model.hpp"

namespace cairn {

/// Noise of depth images, measured at planar patches of surfaces inclined by at most 45 degrees to the image plane.
/// Covers random errors, quantization and errors correlated over a few pixels. Excludes errors constant over a patch of
/// 1/13 of the image width: wrong scale, an error periodic in depth, edges displaced by smoothing.
struct DepthNoise {
  struct Sample {
    float depth = 0;  ///< meters
    float sigma = 0;  ///< standard deviation of depth, meters
    int patches = 0;  ///< number of planar patches
  };
  std::vector<Sample> samples;      ///< by increasing depth; empty: too few planar patches
  SensorModel model;                ///< floor, growth and sharpest fitted to the samples; other fields are defaults
  int frames = 0;                   ///< number of depth images
  int patches = 0;                  ///< number of planar patches of the smallest size
  float correlation_px = 0;         ///< side of a square pixel block with a common error; about 1: independent pixels
  float depth_step = 0;             ///< meters, smallest step of depth; 0: none
  float inverse_depth_step = 0;     ///< 1/m, smallest step of 1/depth, as of sensors that measure disparity; 0: none
  float holes = 0;                  ///< fraction of pixels without measurement
  float flying = 0;                 ///< fraction of depth edges with a pixel between front and back
  float nearest = 0, farthest = 0;  ///< 5th and 95th percentile of depth, meters

  /// Measured standard deviation at a depth, interpolated; nullopt more than 10 % outside the samples.
  [[nodiscard]] std::optional<float> sigma(float depth) const;
  /// Quantization step at a depth, meters; 0: none.
  [[nodiscard]] float step(float depth) const { return std::max(depth_step, inverse_depth_step * depth * depth); }
};

/// Measures the noise of depth images (meters, row-major, 0: no measurement) of a camera. Each image is evaluated
/// alone: the camera may move. 16 images spread over 3 s suffice. Throws std::runtime_error for an image of another
/// size.
[[nodiscard]] DepthNoise measure_depth_noise(const std::vector<std::vector<float>>& images, const Camera& camera);

}  // namespace cairn
