// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Exact depth and color of a scene: closed-form ray intersections with each solid. Color depends on the position only,
// not on the view, as for a diffuse surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "shaders/fetch.h"
#include "shaders/scene.h"
layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { SceneRenderPush push; };
WORDS(0, solids);  // Solid as words
layout(binding = 1, scalar) writeonly buffer Depth { float depth[]; };
layout(binding = 2, scalar) writeonly buffer Cosine { float cosine[]; };  // of the angle between the ray and the
                                                                          // surface normal
layout(binding = 3, scalar) writeonly buffer Color { uint color[]; };
layout(binding = 4, scalar) readonly buffer Rays { vec2 rays[]; };  // at z = 1
layout(binding = 5, scalar) readonly buffer Rows { Rigid rows[]; };  // world_from_camera by row, for a rolling shutter

const float kNoHit = 1e9;

float number_of(uint solid, int k) { return uintBitsToFloat(fetch(solids, int(solid) * kSolidWords + k)); }
vec3 vector_of(uint solid, int k) { return vec3(number_of(solid, k), number_of(solid, k + 1), number_of(solid, k + 2)); }
Solid solid_at(uint i) {
  return Solid(vector_of(i, 0), vector_of(i, 3), vec2(number_of(i, 6), number_of(i, 7)), number_of(i, 8),
               floatBitsToUint(number_of(i, 9)), floatBitsToUint(number_of(i, 10)), number_of(i, 11), vector_of(i, 12),
               vector_of(i, 15));
}

float hash(ivec3 p) {  // Jarzynski & Olano 2020, pcg3d
  uvec3 v = uvec3(p) * 1664525u + 1013904223u;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v ^= v >> 16u;
  v.x += v.y * v.z;
  return float(v.x >> 8) * (1.0 / 16777216.0);
}
float noise(vec3 p) {
  ivec3 i = ivec3(floor(p));
  vec3 f = p - vec3(i);
  f = f * f * (3.0 - 2.0 * f);
  return mix(mix(mix(hash(i), hash(i + ivec3(1, 0, 0)), f.x), mix(hash(i + ivec3(0, 1, 0)), hash(i + ivec3(1, 1, 0)), f.x), f.y),
             mix(mix(hash(i + ivec3(0, 0, 1)), hash(i + ivec3(1, 0, 1)), f.x),
                 mix(hash(i + ivec3(0, 1, 1)), hash(i + ivec3(1, 1, 1)), f.x), f.y),
             f.z);
}
vec3 turn(vec3 v, vec2 heading) {
  return vec3(heading.x * v.x + heading.y * v.z, v.y, -heading.y * v.x + heading.x * v.z);
}

// Parameters at which a ray enters (x) and leaves (y) a box around the origin; the normals of the two faces.
vec2 box_interval(vec3 o, vec3 d, vec3 h, out vec3 near_normal, out vec3 far_normal) {
  vec3 inverse = 1.0 / mix(d, vec3(1e-12), equal(d, vec3(0.0)));
  vec3 a = (-h * sign(inverse) - o) * inverse, b = (h * sign(inverse) - o) * inverse;
  float enter = max(max(a.x, a.y), a.z), leave = min(min(b.x, b.y), b.z);
  near_normal = -sign(d) * vec3(equal(a, vec3(enter)));
  far_normal = -sign(d) * vec3(equal(b, vec3(leave)));
  return vec2(enter, leave);
}

// Normal in the solid's frame (xyz) and depth along the ray (w).
vec4 meet(Solid solid, vec3 o, vec3 d) {
  vec3 near_normal, far_normal;
  if (solid.shape == kBox || solid.shape == kHollow) {
    vec2 t = box_interval(o, d, solid.half_size, near_normal, far_normal);
    if (solid.shape == kHollow) return vec4(far_normal, t.x < t.y && t.y > 0.0 ? t.y : kNoHit);
    return vec4(near_normal, t.x < t.y && t.x > 0.0 ? t.x : kNoHit);
  }
  bool sphere = solid.shape == kSphere;
  vec3 mask = sphere ? vec3(1) : vec3(1, 0, 1);
  vec3 om = o * mask, dm = d * mask;
  float a = dot(dm, dm), b = dot(om, dm), c = dot(om, om) - solid.half_size.x * solid.half_size.x;
  float root = b * b - a * c;
  float t = root > 0.0 ? (-b - sqrt(root)) / a : kNoHit;
  vec3 at = o + d * t;
  if (sphere) return vec4(at / solid.half_size.x, t > 0.0 ? t : kNoHit);
  bool side = t > 0.0 && t < kNoHit && abs(at.y) < solid.half_size.y;
  float cap = (-solid.half_size.y * sign(d.y) - o.y) / (d.y == 0.0 ? 1e-12 : d.y);
  vec3 on_cap = o + d * cap;
  bool top = cap > 0.0 && dot(on_cap.xz, on_cap.xz) < solid.half_size.x * solid.half_size.x;
  return side ? vec4(at * mask / solid.half_size.x, t) : vec4(0.0, -sign(d.y), 0.0, top ? cap : kNoHit);
}

vec3 texture_at(Solid solid, vec3 p, vec3 n) {
  vec3 q = p / solid.scale;
  vec3 on_grid = floor(q + 1e-3 * n);  // a face on the border of cells belongs to a single cell
  float grain = 0.55 * noise(p * 37.0) + 0.3 * noise(p * 83.0 + 7.0) + 0.15 * noise(p * 171.0 + 3.0);
  float blotch = noise(p * 4.0 + 11.0);
  vec3 base = solid.color;
  if (solid.pattern == kChecker) base = mod(on_grid.x + on_grid.y + on_grid.z, 2.0) < 0.5 ? solid.color : solid.second;
  if (solid.pattern == kWood) {
    float rings = 0.5 + 0.5 * sin(q.y * 9.0 + q.z * 14.0 + 5.0 * noise(q * vec3(1.0, 6.0, 6.0)));
    base = mix(solid.color, solid.second, rings);
  }
  if (solid.pattern == kTiles) {
    vec3 edge = abs(fract(q + 1e-3 * n) - 0.5) * (1.0 - abs(n));
    float grout = smoothstep(0.46, 0.48, max(max(edge.x, edge.y), edge.z));
    base = mix(solid.color * (0.85 + 0.3 * hash(ivec3(on_grid))), solid.second, grout);
  }
  if (solid.pattern == kPatches) {
    ivec3 cell = ivec3(on_grid);
    vec3 random = vec3(hash(cell), hash(cell + 91), hash(cell + 173));
    base = mix(mix(solid.color, solid.second, random.x), random, 0.6);
  }
  return base * (0.62 + 0.5 * grain + 0.22 * (blotch - 0.5));
}

// True if the bounding ball of a solid intersects the cone around the rays of a workgroup.
bool is_near(uint i, vec3 o, vec3 axis, float cosine, float sine) {
  vec3 m = vector_of(i, 0) - o;
  float reach = number_of(i, 8), along = dot(m, axis), beside = sqrt(max(dot(m, m) - along * along, 0.0));
  bool in_front = along * cosine + beside * sine >= 0.0;  // the nearest part of the cone is not its tip
  return in_front ? beside * cosine - along * sine <= reach : dot(m, m) <= reach * reach;
}

vec3 ray_of(vec2 pixel) {
  uvec2 at = min(uvec2(pixel), uvec2(push.camera.width, push.camera.height) - 1u);
  return push.is_bent != 0u ? vec3(rays[at.y * push.camera.width + at.x], 1.0) : ray_through(push.camera, pixel);
}

void main() {
  uvec2 pixel = gl_GlobalInvocationID.xy;
  Rigid world_from_camera = push.world_from_camera;
  if (push.is_rolling != 0u) world_from_camera = rows[min(pixel.y, push.camera.height - 1u)];
  vec3 d = rotate(world_from_camera, ray_of(vec2(pixel)));
  vec3 o = world_from_camera.t;
  vec2 corner = vec2(gl_WorkGroupID.xy * gl_WorkGroupSize.xy), size = vec2(gl_WorkGroupSize.xy) - 1.0;
  vec3 axis = normalize(ray_of(corner + 0.5 * size));
  float cosine_of_cone = 1.0;
  for (uint c = 0u; c < 4u; ++c)
    cosine_of_cone = min(cosine_of_cone, dot(axis, normalize(ray_of(corner + size * vec2(c & 1u, c >> 1u)))));
  axis = rotate(push.world_from_camera, axis);
  float sine_of_cone = sqrt(max(1.0 - cosine_of_cone * cosine_of_cone, 0.0)) + (push.is_bent != 0u ? 1e-2 : 1e-4);  // margin for rounding
  vec4 best = vec4(0.0, 0.0, 0.0, kNoHit);
  uint which = 0u;
  // Computed, because lavapipe numbers the threads of a subgroup of 16 incorrectly (Mesa 22.3).
  uint lane = subgroupExclusiveAdd(1u), step = min(subgroupAdd(1u), 32u);
  for (uint first = 0u; first < push.solids; first += step) {
    // Most solids are outside the workgroup's cone: each thread tests one solid, then all threads intersect the
    // remaining solids.
    uint mine = first + lane;
    bool near = lane < step && mine < push.solids &&
                (push.is_rolling != 0u ||  // rows have different origins
                 is_near(min(mine, push.solids - 1u), o, axis, cosine_of_cone, sine_of_cone));
    uint marked = subgroupOr(near ? 1u << lane : 0u);
    while (marked != 0u) {
      uint i = first + findLSB(marked);
      marked &= marked - 1u;
      Solid solid = solid_at(i);
      vec4 hit = meet(solid, turn(o - solid.center, solid.heading), turn(d, solid.heading));
      which = hit.w < best.w ? i : which;
      best = hit.w < best.w ? hit : best;
    }
  }
  if (pixel.x >= push.camera.width || pixel.y >= push.camera.height) return;
  uint at = pixel.y * push.camera.width + pixel.x;
  bool found = best.w < 100.0;
  Solid solid = solid_at(which);
  vec3 n = turn(best.xyz, vec2(solid.heading.x, -solid.heading.y));
  vec3 p = turn(o + d * best.w - solid.center, solid.heading);
  float light = 0.75 + 0.25 * dot(n, normalize(vec3(0.4, -0.8, -0.45)));
  vec3 shade = clamp(texture_at(solid, p, best.xyz) * light * 1.15, 0.0, 1.0);
  depth[at] = found ? best.w : 0.0;
  cosine[at] = found ? -dot(n, normalize(d)) : 0.0;
  color[at] = packUnorm4x8(vec4(found ? shade : vec3(0.0), 1.0));
}
