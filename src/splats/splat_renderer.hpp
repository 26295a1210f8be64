// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/eval/evaluation.hpp"
#include "splats/rasterizer.hpp"

namespace cairn {

/// Renders splats as RenderedView, for comparison with images.
class SplatRenderer {
 public:
  SplatRenderer(gpu::Device& device, const Splats& splats) : rasterizer_(device), model_(upload(device, splats)) {}
  /// Color over black; the mean depth where the opacity exceeds one half, else 0.
  [[nodiscard]] RenderedView operator()(const Camera& camera, const Eigen::Isometry3d& world_from_camera);

 private:
  SplatRasterizer rasterizer_;
  SplatModel model_;
};

}  // namespace cairn
