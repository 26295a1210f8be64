// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <vector>

#include "cairn/mapping/frame.hpp"
#include "gpu/buffer.hpp"

namespace cairn {

/// Vertex and normal map in the frame of a camera, by pixel; see shaders/surface.h.
struct VertexNormalMap {
  Camera camera;
  gpu::Buffer points;
};

/// Preprocessed frame on the device. The buffers are owned by Preprocessor and valid until its next call.
struct FramePyramid {
  std::vector<const VertexNormalMap*> levels;  // smoothed, finest first; points from `finest_level` on
  /// Input of the photometric term by level (SurfacePointsPush); empty without color, null above `finest_level`.
  std::vector<const gpu::Buffer*> packed;
  const gpu::Buffer* fusion = nullptr;  // (depth bits, color) by pixel: rectified, without flying pixels, not smoothed
  bool has_color = false;
  /// Registers color from a separate color camera to `fusion`; before the call the color words are 0.
  std::function<void()> register_color_to_depth;
  /// The frame's images at its time, corrected on demand for a rolling shutter. The frame must still exist at the call.
  std::function<const Frame&()> images;
};

}  // namespace cairn
