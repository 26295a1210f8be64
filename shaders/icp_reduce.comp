// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// One linearization of projective point-to-plane ICP (Chen & Medioni 1991; Newcombe et al. 2011, eq. 17-24): each live
// point is matched with the model point at the pixel of its projection. Each subgroup writes its own sums; pose_step
// adds them in a fixed order.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "shaders/fetch.h"
#include "shaders/track.h"
#include "shaders/surface.h"
layout(constant_id = 4) const uint kIsRolling = 0;
layout(local_size_x = 64, local_size_x_id = 15) in;
layout(push_constant, scalar) uniform Push { IcpReducePush push; };
PAIRS(0, live);
PAIRS(1, model);
layout(binding = 2, scalar) uniform State { AlignState state; };
layout(binding = 3, scalar) writeonly buffer Sums { IcpSums sums[]; };

void main() {
  // Named sums: an array costs several times more on a CPU device.
  vec3 rr0 = vec3(0), rr1 = vec3(0), rt0 = vec3(0), rt1 = vec3(0), rt2 = vec3(0), tt0 = vec3(0), tt1 = vec3(0);
  vec3 br = vec3(0), bt = vec3(0);
  vec4 counts = vec4(0);
  Pinhole camera = local(push.camera);
  Rigid model_from_live = local(state.model_from_live);
  Rigid model_from_corrected = local(state.model_from_corrected);
  float readout = state.readout;
  float max_squared = push.max_distance * push.max_distance, min_cosine = push.min_cosine, huber = push.huber;
  float inverse_cut = push.cut > 0.0 ? 1.0 / push.cut : 0.0;
  bool crossed = push.crossed != 0u;
  int width = int(camera.width), height = int(camera.height);
  Tile tile = tile_of(camera, push.tile, state.stride, int(gl_WorkGroupID.x), int(gl_LocalInvocationIndex),
                      int(gl_WorkGroupSize.x));
  ivec2 at = tile.begin;
  for (int k = 0; k < tile.steps; ++k) {
    bool exists = at.x < width && at.y < height;
    int i = exists ? at.y * width + at.x : 0;
    uvec2 l = fetch(live, i);
    float z = uintBitsToFloat(l.x);
    vec3 seen_at = ray_through(camera, vec2(at)) * z, p = transform(model_from_live, seen_at);
    float share = 0.0;
    if (kIsRolling != 0u) {
      share = readout * row_share(float(at.y), camera);
      p += share * (p - transform(model_from_corrected, seen_at));
    }
    ivec2 pixel = ivec2(floor(project(camera, p) + 0.5));
    bool valid = exists && l.y != 0u && z > 0.0 && p.z > 0.0;
    bool inside = valid && pixel.x >= 0 && pixel.y >= 0 && pixel.x < width && pixel.y < height;
    uvec2 m = inside ? fetch(model, pixel.y * width + pixel.x) : uvec2(0);
    float zm = uintBitsToFloat(m.x);
    bool seen = inside && zm > 0.0 && m.y != 0u;
    vec3 n = unpack_normal(m.y);
    vec3 gap = ray_through(camera, vec2(pixel)) * zm - p;
    vec3 live_normal = rotate(model_from_live, unpack_normal(l.y));
    // No test of the angle for crossed pairs: selecting agreeing normals would select correlated noise.
    bool inlier = seen && dot(gap, gap) < max_squared &&
                  (crossed || dot(live_normal, n) > min_cosine);

    float inverse_sigma = 1.0 / depth_noise(z);
    float r = dot(n, gap) * inverse_sigma;
    float w = inlier ? min(1.0, huber / max(abs(r), 1e-6)) : 0.0;  // Huber 1964
    float cut_off = r * inverse_cut, rest = max(0.0, 1.0 - cut_off * cut_off);  // Beaton & Tukey 1974
    w *= rest * rest;
    if (!inlier) r = 0.0;
    float scale = inverse_sigma * (1.0 + share);
    vec3 jt = inlier ? n * scale : vec3(0);
    vec3 jr = inlier ? cross(p, n) * scale : vec3(0);
    vec3 wr = jr * w, wt = jt * w;
    if (crossed && inlier) {
      jt = live_normal * scale;
      jr = cross(p, live_normal) * scale;
    }
    rr0 += wr.x * jr;
    rr1 += vec3(wr.y * jr.y, wr.y * jr.z, wr.z * jr.z);
    rt0 += wr.x * jt;
    rt1 += wr.y * jt;
    rt2 += wr.z * jt;
    tt0 += wt.x * jt;
    tt1 += vec3(wt.y * jt.y, wt.y * jt.z, wt.z * jt.z);
    br += wr * r;
    bt += wt * r;
    counts += vec4(w * r * r, inlier ? 1.0 : 0.0, seen ? 1.0 : 0.0, valid ? 1.0 : 0.0);
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
  if (subgroupElect())
    sums[gl_WorkGroupID.x * gl_NumSubgroups + gl_SubgroupID] =
        IcpSums(NormalEquations(rr0, rr1, rt0, rt1, rt2, tt0, tt1, br, bt), counts.x, counts.y, counts.z, counts.w,
                gl_NumSubgroups);
}
