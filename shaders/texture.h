// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color of surface points from the keyframes in which they are visible. A keyframe is on the device as a view: by pixel
// (depth and confidence as half floats, color), and an image of a quarter of the size with the low frequencies of the
// color.
#ifndef CAIRN_TEXTURE_H
#define CAIRN_TEXTURE_H
#include "shaders/types.h"
#include "shaders/volume.h"
#ifdef __cplusplus
#include <cmath>
namespace cairn::shader {
#endif

const uint kTileSide = 8;     // texels
const uint kTileTexels = 64;  // texels with a common selection of views
const uint kTileViews = 12;   // maximum number of views per tile
const uint kNoView = 0xffffffffu;
const uint kGainColumns = 8, kGainRows = 6;  // cells of an image with separate gains

struct Texel {     // a point under a texel
  vec3 position;   // meters, world
  uint normal;     // packed; 0: no point
  uint color;     // color without views; bytes R, G, B
};

struct TextureView {
  Rigid camera_from_world;
  vec3 velocity;   // of the camera in its own frame, m/s
  vec3 turn_rate;  // rad/s
  float delay;     // seconds from the depth image to the color image
  uvec2 pixels;    // device addresses
  uvec2 blurred;
};

#ifdef __cplusplus
static_assert(sizeof(TextureView) == 4 * 23);  // see view_at
#endif

struct TexturePreparePush {
  Pinhole camera;
};

struct TextureReferencePush {
  VolumeView volume;
  Pinhole camera;
  Rigid world_from_camera;
  float tolerance;  // as in TextureBlendPush
};

struct TextureExposePush {
  uint width, height;  // pixels
  uint words;          // per pixel; the last is its color
};

struct TextureBlendPush {
  Pinhole camera;
  uint tiles;
  uint views;       // number of TextureView
  float tolerance;  // meters in addition to the noise, maximum depth of a surface behind the measurement
};

#ifdef __cplusplus
/// pack_normal and unpack_normal of shaders/types.h on the host.
inline uint pack_normal(const Eigen::Vector3f& normal) {
  const Eigen::Vector3f n = normal / normal.lpNorm<1>();
  Eigen::Vector2f e = n.head<2>();
  if (n.z() < 0)
    e = {(1 - std::abs(n.y())) * (n.x() >= 0 ? 1.0f : -1.0f), (1 - std::abs(n.x())) * (n.y() >= 0 ? 1.0f : -1.0f)};
  const auto word = [](float f) { return static_cast<uint>(std::lround((f * 0.5f + 0.5f) * 65535.0f)); };
  const uint code = word(e.x()) | word(e.y()) << 16;
  return code == 0 ? 0xffffffffu : code;
}
inline Eigen::Vector3f unpack_normal(uint code) {
  Eigen::Vector3f n(static_cast<float>(code & 0xffffu) / 32767.5f - 1, static_cast<float>(code >> 16) / 32767.5f - 1, 0);
  n.z() = 1 - std::abs(n.x()) - std::abs(n.y());
  const float t = std::max(-n.z(), 0.0f);
  n.x() += n.x() >= 0 ? -t : t;
  n.y() += n.y() >= 0 ? -t : t;
  return n.normalized();
}
}  // namespace cairn::shader
#else
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#include "shaders/fetch.h"
#include "shaders/surface.h"
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer ViewPixels { uvec2 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer ViewBlurred { uint v[]; };

float float_at(itextureBuffer words, int i) { return uintBitsToFloat(fetch(words, i)); }
vec3 vec3_at(itextureBuffer words, int i) {
  return vec3(float_at(words, i), float_at(words, i + 1), float_at(words, i + 2));
}
// A TextureView in a buffer of words.
TextureView view_at(itextureBuffer words, uint number) {
  int i = int(number) * 23;
  Rigid pose = Rigid(vec3_at(words, i), vec3_at(words, i + 3), vec3_at(words, i + 6), vec3_at(words, i + 9));
  return TextureView(pose, vec3_at(words, i + 12), vec3_at(words, i + 15), float_at(words, i + 18),
                     uvec2(fetch(words, i + 19), fetch(words, i + 20)),
                     uvec2(fetch(words, i + 21), fetch(words, i + 22)));
}
ViewPixels pixels_at(itextureBuffer words, uint number) {
  int i = int(number) * 23 + 19;
  return ViewPixels(uvec2(fetch(words, i), fetch(words, i + 1)));
}

const float kExposure = 0.01;  // seconds, typical for an indoor image

// Weight of a view for a point: its texels per square meter, reduced for motion blur and at depth edges and image
// borders. 0: the point is not visible. `pixel` is in the color image, which was taken `delay` later.
float view_weight(TextureView view, Pinhole camera, vec3 position, vec3 normal, float tolerance, out vec2 pixel) {
  vec3 p = transform(view.camera_from_world, position), moving = view.velocity + cross(view.turn_rate, p);
  vec3 later = p - view.delay * moving;
  float z = max(p.z, 0.05);
  vec2 last = vec2(camera.width - 1u, camera.height - 1u) - 0.001;
  vec2 in_depth = project(camera, vec3(p.xy, z)), in_color = project(camera, vec3(later.xy, max(later.z, 0.05)));
  pixel = clamp(in_color, vec2(0.0), last);
  vec2 measured = clamp(in_depth, vec2(0.0), last);
  ivec2 nearest = ivec2(measured + 0.5);
  vec2 seen = unpackHalf2x16(ViewPixels(view.pixels).v[uint(nearest.y) * camera.width + uint(nearest.x)].x);
  float cosine = -dot(rotate(view.camera_from_world, normal), p) / length(p);
  bool inside = p.z > 0.05 && in_color == pixel && in_depth == measured && seen.x > 0.0 && cosine > 0.1 &&
                abs(z - seen.x) < tolerance + 3.0 * depth_noise(z);
  vec2 blur = vec2(camera.fx, camera.fy) / z * (moving.xy - p.xy / z * moving.z) * kExposure;  // pixels
  float sharp = 1.0 / (1.0 + dot(blur, blur));
  return inside ? seen.y * sharp * cosine * cosine / max(z * z, 0.25) : 0.0;
}

vec3 color_of(uint word) { return unpackUnorm4x8(word).rgb; }

// Bilinear.
vec3 sharp_color(ViewPixels pixels, Pinhole camera, vec2 pixel) {
  uvec2 corner = uvec2(pixel);
  vec2 f = pixel - vec2(corner);
  uint i = corner.y * camera.width + corner.x;
  vec3 above = mix(color_of(pixels.v[i].y), color_of(pixels.v[i + 1u].y), f.x);
  vec3 below = mix(color_of(pixels.v[i + camera.width].y), color_of(pixels.v[i + camera.width + 1u].y), f.x);
  return mix(above, below, f.y);
}

// Pixel (i, j) of the blurred image is the mean around the center of the block of 4 x 4 that starts at 4 (i, j).
vec3 smooth_color(TextureView view, Pinhole camera, vec2 pixel) {
  uvec2 size = uvec2(camera.width >> 2, camera.height >> 2);
  vec2 at = clamp((pixel - 1.5) * 0.25, vec2(0.0), vec2(size - 1u) - 0.001);
  uvec2 corner = uvec2(at);
  vec2 f = at - vec2(corner);
  uint i = corner.y * size.x + corner.x;
  ViewBlurred pixels = ViewBlurred(view.blurred);
  vec3 above = mix(color_of(pixels.v[i]), color_of(pixels.v[i + 1u]), f.x);
  vec3 below = mix(color_of(pixels.v[i + size.x]), color_of(pixels.v[i + size.x + 1u]), f.x);
  return mix(above, below, f.y);
}
#endif
#endif
