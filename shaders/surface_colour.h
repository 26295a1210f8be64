// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Where a depth pixel's point is seen by the colour camera.
#ifndef CAIRN_SURFACE_COLOUR_H
#define CAIRN_SURFACE_COLOUR_H
#include "shaders/surface.h"

// Its pixel; false where the camera does not see it. `z`: its depth, there then.
bool seen_at(SurfaceColourPush view, uvec2 depth_pixel, inout float z, out vec2 pixel) {
  vec3 p = transform(view.colour_from_depth, z * vec3(depth_pixel, 1.0));
  z = p.z;
  vec2 n = p.xy / max(p.z, 1e-3);
  pixel = bend(view.lens, n) * vec2(view.camera.fx, view.camera.fy) + vec2(view.camera.cx, view.camera.cy);
  return p.z > 1e-3 && dot(n, n) < view.widest * view.widest && min(pixel.x, pixel.y) >= 0.0 &&
         pixel.x <= float(view.camera.width - 1u) && pixel.y <= float(view.camera.height - 1u);
}

// Cells along the colour image, as many as nearest_bytes of preprocess.cpp makes; by float, since a CPU device divides no
// vectors of integers.
ivec2 cells_of(SurfaceColourPush view) {
  return ivec2((vec2(view.camera.width, view.camera.height) - 0.5) / float(view.cell)) + 1;
}
#endif
