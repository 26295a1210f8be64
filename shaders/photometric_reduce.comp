// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// One linearization of the photometric term: the brightness of live points compared to a keyframe image (Steinbruecker
// et al. 2011; t-distributed residuals as in Kerl, Sturm & Cremers 2013; affine brightness as in Engel et al. 2015).
// Each subgroup writes its own sums; pose_step adds them in a fixed order.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "shaders/fetch.h"
#include "shaders/track.h"
#include "shaders/surface.h"
layout(constant_id = 4) const uint kIsRolling = 0;
layout(local_size_x = 64, local_size_x_id = 15) in;
layout(push_constant, scalar) uniform Push { PhotometricReducePush push; };
PAIRS(0, points);
PAIRS(1, live);      // packed, see surface.h
PAIRS(2, keyframe);  // packed
layout(binding = 3, scalar) uniform State { AlignState state; };
layout(binding = 4, scalar) writeonly buffer Sums { PhotometricSums sums[]; };

// Brightness (x) and its image gradient (y, z), interpolated between four pixels; w = 0 if any of them has none.
vec4 bilinear(uvec2 p, vec2 f) {
  ivec4 codes = ivec4(p.x & 0xfffu, (p.x >> 12) & 0xfffu, p.y & 0xfffu, (p.y >> 12) & 0xfffu);
  vec4 v = (vec4(codes) - 1.0) * (1.0 / 4094.0);
  float top = mix(v.x, v.y, f.x), bottom = mix(v.z, v.w, f.x);
  return vec4(mix(top, bottom, f.y), mix(v.y - v.x, v.w - v.z, f.y), bottom - top,
              min(min(codes.x, codes.y), min(codes.z, codes.w)) > 0 ? 1.0 : 0.0);
}

void main() {
  vec3 rr0 = vec3(0), rr1 = vec3(0), rt0 = vec3(0), rt1 = vec3(0), rt2 = vec3(0), tt0 = vec3(0), tt1 = vec3(0);
  vec3 br = vec3(0), bt = vec3(0);
  vec4 counts = vec4(0), moments = vec4(0);
  Pinhole camera = local(push.camera);
  Rigid keyframe_from_live = compose(local(push.keyframe_from_model), local(state.model_from_live));
  Rigid keyframe_from_corrected = compose(local(push.keyframe_from_model), local(state.model_from_corrected));
  float readout = state.readout;
  vec3 rotation = push.rotation, translation = push.translation;
  float gain = state.gain, bias = state.bias, inverse_sigma = 1.0 / state.sigma;
  int width = int(camera.width), height = int(camera.height);
  Tile tile = tile_of(camera, push.tile, state.stride, int(gl_WorkGroupID.x), int(gl_LocalInvocationIndex),
                      int(gl_WorkGroupSize.x));
  vec2 focal = vec2(camera.fx, camera.fy);
  ivec2 at = tile.begin;
  for (int k = 0; k < tile.steps; ++k) {
    bool exists = at.x < width && at.y < height;
    int i = exists ? at.y * width + at.x : 0;
    float z = uintBitsToFloat(fetch(points, i).x);
    vec3 p = ray_through(camera, vec2(at)) * z;
    // Projection into the color camera at its own time.
    vec2 u = project(camera, p + cross(rotation, p) + translation);
    vec3 q = transform(keyframe_from_live, p);
    float share = 0.0;
    if (kIsRolling != 0u) {
      share = readout * row_share(float(at.y), camera);
      q += share * (q - transform(keyframe_from_corrected, p));
    }
    vec2 v = project(camera, q);
    bool inside = exists && z > 0.0 && q.z > 0.1 && min(min(u.x, u.y), min(v.x, v.y)) >= 0.0 &&
                  max(u.x, v.x) < float(width - 1) && max(u.y, v.y) < float(height - 1);
    if (!inside) u = v = vec2(0.0);
    ivec2 iu = ivec2(u), iv = ivec2(v);
    uvec2 pl = inside ? fetch(live, iu.y * width + iu.x) : uvec2(0);
    uvec2 pk = inside ? fetch(keyframe, iv.y * width + iv.x) : uvec2(0);
    vec4 a = bilinear(pl, u - vec2(iu)), key = bilinear(pk, v - vec2(iv));
    float zk = float(int((pk.x >> 24) | ((pk.y >> 24) << 8))) * 0.001;
    // Excludes points occluded in the keyframe or in front of its surface.
    bool seen = inside && a.w > 0.0 && key.w > 0.0 && (zk == 0.0 || abs(zk - q.z) < 0.05 + 0.03 * q.z);

    float r = seen ? key.x - (gain * a.x + bias) : 0.0;
    float e = r * inverse_sigma;
    float w = seen ? 6.0 / (5.0 + e * e) : 0.0;  // t-distribution with 5 degrees of freedom
    vec2 g = focal * key.yz * ((1.0 + share) / q.z);
    vec3 jt = seen ? vec3(g, -dot(g, q.xy) * (1.0 / q.z)) : vec3(0);
    vec3 jr = seen ? cross(q, jt) : vec3(0);
    vec3 wr = jr * w, wt = jt * w;
    rr0 += wr.x * jr;
    rr1 += vec3(wr.y * jr.y, wr.y * jr.z, wr.z * jr.z);
    rt0 += wr.x * jt;
    rt1 += wr.y * jt;
    rt2 += wr.z * jt;
    tt0 += wt.x * jt;
    tt1 += vec3(wt.y * jt.y, wt.y * jt.z, wt.z * jt.z);
    br -= wr * r;
    bt -= wt * r;
    counts += vec4(w * r * r, seen ? 1.0 : 0.0, seen && abs(e) < 2.5 ? 1.0 : 0.0, w);
    moments += w * vec4(a.x, key.x, a.x * a.x, a.x * key.x);
    at = step_in(tile, at);
  }
  rr0 = subgroupAdd(rr0);
  rr1 = subgroupAdd(rr1);
  rt0 = subgroupAdd(rt0);
  rt1 = subgroupAdd(rt1);
  rt2 = subgroupAdd(rt2);
  tt0 = subgroupAdd(tt0);
  tt1 = subgroupAdd(tt1);
  br = subgroupAdd(br);
  bt = subgroupAdd(bt);
  counts = subgroupAdd(counts);
  moments = subgroupAdd(moments);
  if (subgroupElect())
    sums[push.first + gl_WorkGroupID.x * gl_NumSubgroups + gl_SubgroupID] =
        PhotometricSums(NormalEquations(rr0, rr1, rt0, rt1, rt2, tt0, tt1, br, bt), counts.x, counts.y, counts.z, counts.w,
                        moments.x, moments.y, moments.z, moments.w, gl_NumSubgroups);
}
