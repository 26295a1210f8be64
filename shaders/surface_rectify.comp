// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Corrects lens distortion and, using the camera motion, the rolling shutter: each output pixel finds the raw pixel
// whose point projects to it at the frame's time. Color is bilinear. Depth is the nearest measurement (an average
// across an edge is no surface), except with a rolling shutter: interpolated between four pixels of a common surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface_color.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceRectifyPush push; };
layout(constant_id = 36) const uint kKeepsLens = 0;  // corrects the shutter only; the rays of the lens are given per
                                                     // pixel
layout(constant_id = 37) const uint kHasDepth = 1;
layout(constant_id = 38) const uint kHasColor = 1;  // color registered to depth, or an image without depth
FLOATS(0, raw_depth);
WORDS(1, raw_color);
PAIRS(2, rays);
layout(binding = 3, scalar) writeonly buffer Depth { float depth[]; };
layout(binding = 4, scalar) writeonly buffer Color { uint color[]; };

const float kOneSurface = 0.03;  // relative depth difference up to which four pixels are interpolated

int width, height;

float measured(vec2 pixel) {
  ivec2 nearest = ivec2(clamp(round(pixel), vec2(0.0), vec2(width - 1, height - 1)));
  return fetch(raw_depth, nearest.y * width + nearest.x);
}

// Linear in inverse depth between pixels of the same surface; else the nearest pixel.
float measured_between(int at, vec2 f) {
  vec4 z = vec4(fetch(raw_depth, at), fetch(raw_depth, at + 1), fetch(raw_depth, at + width),
                fetch(raw_depth, at + width + 1));
  float min_z = min(min(z.x, z.y), min(z.z, z.w)), max_z = max(max(z.x, z.y), max(z.z, z.w));
  vec4 q = 1.0 / max(z, vec4(1e-3));
  vec2 column = f.x < 0.5 ? z.xz : z.yw;
  float nearest = f.y < 0.5 ? column.x : column.y;
  return min_z > 0.0 && max_z - min_z < kOneSurface * min_z ? 1.0 / mix(mix(q.x, q.y, f.x), mix(q.z, q.w, f.x), f.y)
                                                           : nearest;
}

void main() {
  Pinhole camera = view().camera;  // the constants describe the camera of these images
  width = int(camera.width), height = int(camera.height);
  ivec2 place = thread_place();
  if (place.x >= width || place.y >= height) return;
  int i = place.y * width + place.x;
  bool has_depth = kHasDepth != 0u, is_rolling = view().is_rolling != 0u;
  vec2 wanted = kKeepsLens != 0u ? uintBitsToFloat(fetch(rays, i)) : ray_through(camera, vec2(place)).xy;
  vec2 n = wanted, pixel = pixel_of_view(n);
  ShutterMotion motion = local(push.motion);
  float distance = push.distance, rows = 1.0 / float(height);
  if (is_rolling) {
    // A fixed-point step with the row's derivative: the offset is proportional to the delay of the row that saw the
    // point, up to the acceleration.
    float z = has_depth ? measured(pixel) : 0.0, row = (pixel.y + 0.5) * rows;
    vec3 p = at_once(motion, (z > 0.0 ? z : distance) * vec3(n, 1.0), row);
    vec2 offset = clamp(wanted - p.xy / max(p.z, 1e-3), -1.0, 1.0);
    float delay = row - 0.5, change = offset.y * view().camera.fy * rows / (abs(delay) > 1e-3 ? delay : 1e-3);
    n += offset / (1.0 - clamp(change, -0.5, 0.5));
    pixel = pixel_of_view(n);
  }

  vec2 p = clamp(pixel, vec2(0.0), vec2(width, height) - 1.001);
  ivec2 q = ivec2(p);
  vec2 f = fract(p);
  int at = q.y * width + q.x;
  bool inside = all(greaterThanEqual(pixel, vec2(-0.5))) && all(lessThan(pixel, vec2(width, height) - 0.5));
  if (has_depth) {
    float z = is_rolling ? measured_between(at, f) : measured(pixel);
    if (is_rolling && z > 0.0) z = max(at_once(motion, z * vec3(n, 1.0), (pixel.y + 0.5) * rows).z, 0.0);
    depth[i] = inside ? z : 0.0;
  }
  if (kHasColor != 0u) {
    uint a = fetch(raw_color, at), b = fetch(raw_color, at + 1), c = fetch(raw_color, at + width),
         d = fetch(raw_color, at + width + 1);
    ivec3 rgb = ivec3(mix(mix(levels_of(a), levels_of(b), f.x), mix(levels_of(c), levels_of(d), f.x), f.y) + 0.5);
    // No color next to pixels without color.
    uint word = uint(rgb.r | (rgb.g << 8) | (rgb.b << 16)) | (a & b & c & d & 0xff000000u);
    color[i] = inside || !is_rolling ? word : 0xff000000u;
  }
}
