// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Points and normals from depth, and packed pixels (see surface.h) from intensities. The normal points to the camera;
// all four neighbors must be on the same surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfacePointsPush push; };
FLOATS(0, depth);
FLOATS(1, intensity);
layout(binding = 2, scalar) writeonly buffer Points { uvec2 points[]; };
layout(binding = 3, scalar) writeonly buffer Packed { uvec2 packed_pixels[]; };

uint code(float v) { return v < 0.0 ? 0u : 1u + uint(int(v * 4094.0 + 0.5)); }

void main() {
  Pinhole camera = local(push.camera);
  int width = int(camera.width), height = int(camera.height);
  ivec2 p = thread_place();
  if (p.x >= width || p.y >= height) return;
  int i = p.y * width + p.x;
  float z = fetch(depth, i);
  bool inner = p.x > 0 && p.y > 0 && p.x < width - 1 && p.y < height - 1;
  float l = fetch(depth, inner ? i - 1 : i), r = fetch(depth, inner ? i + 1 : i);
  float u = fetch(depth, inner ? i - width : i), d = fetch(depth, inner ? i + width : i);

  // A plane seen at less than about 5 degrees changes depth by 12 pixel widths from pixel to pixel.
  float jump = 12.0 * z / camera.fx + 3.0 * depth_noise(z);
  bool connected = inner && min(min(l, r), min(u, d)) > 0.0 && max(max(abs(l - z), abs(r - z)), max(abs(u - z), abs(d - z))) < jump;
  vec2 q = vec2(p);
  vec3 dx = ray_through(camera, q + vec2(1, 0)) * r - ray_through(camera, q - vec2(1, 0)) * l;
  vec3 dy = ray_through(camera, q + vec2(0, 1)) * d - ray_through(camera, q - vec2(0, 1)) * u;
  vec3 n = cross(dy, dx);
  points[i] = uvec2(floatBitsToUint(z), connected && z > 0.0 ? pack_normal(n / max(length(n), 1e-12)) : 0u);
  if (push.has_color == 0u) return;
  // Input of the photometric term: intensities of four neighbors, and depth; empty in the last row and column.
  bool has_four = p.x + 1 < width && p.y + 1 < height;
  int right = has_four ? 1 : 0, below = has_four ? width : 0;
  uint depth_code = uint(int(min(z * 1000.0 + 0.5, 65535.0)));
  uvec2 upper = uvec2(code(fetch(intensity, i)), code(fetch(intensity, i + right)));
  uvec2 lower = uvec2(code(fetch(intensity, i + below)), code(fetch(intensity, i + below + right)));
  packed_pixels[i] = has_four ? uvec2(upper.x | (upper.y << 12) | ((depth_code & 0xffu) << 24),
                                      lower.x | (lower.y << 12) | ((depth_code >> 8) << 24))
                              : uvec2(0);
}
