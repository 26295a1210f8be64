// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <vector>

#include "cairn/frame.hpp"
#include "gpu/buffer.hpp"

namespace cairn {

/// Points with normals in the frame of a camera, by pixel; see shaders/surface.h.
struct VertexNormalMap {
  Camera camera;
  gpu::Buffer points;
};

/// A frame on the device. The buffers belong to Preprocessor and hold until its next call.
struct Surface {
  std::vector<const VertexNormalMap*> levels;  // smoothed, the finest first; points from `finest_level` on
  /// By level what the photometric term reads (SurfacePointsPush); empty without colour, null above `finest_level`.
  std::vector<const gpu::Buffer*> packed;
  const gpu::Buffer* fusion = nullptr;  // (depth bits, colour) by pixel: rectified, without flying pixels, not smoothed
  bool has_colour = false;
  /// Of a colour camera beside the depth camera `fusion` has colour once this was called; until then its words are 0.
  std::function<void()> bring_colour;
  /// The frame's images as of its time: where the shutter rolls they are made when they are asked for. The frame itself
  /// must still be there then.
  std::function<const Frame&()> images;
};

}  // namespace cairn
