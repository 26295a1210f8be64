// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// One axis of the separable distance transform: the lower envelope of parabolas along each line of a box (Felzenszwalb
// & Huttenlocher 2012, with sites as in Cao et al. 2010). The parabola of a site is centered at the site, not at its
// voxel's center. A site hidden by another site of its line may still be nearer elsewhere, by less than a voxel:
// esdf_nearest therefore checks neighbors. One thread per line.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfLinesPush push; };
WORDS(0, from);                                               // site addresses
layout(binding = 1, scalar) writeonly buffer To { uint to[]; };  // nearest site on the line
layout(binding = 2, scalar) buffer Stack { Parabola stack[]; };
WORDS(3, surface);
WORDS(4, places);

const float kMinSiteGap = 1e-3;  // voxels; sites ordered differently from their voxels also count as coincident

void main() {
  field = local(push.field);
  ivec3 size = ivec3(push.size.x, push.size.y, push.size.z), origin = ivec3(push.first.x, push.first.y, push.first.z);
  uint axis = push.axis;
  int u = int(gl_GlobalInvocationID.x), v = int(gl_GlobalInvocationID.y), row = int(push.row) + v;
  int across = axis == 2u ? size.y : size.z, count = axis == 2u ? size.z : axis == 1u ? size.y : size.x;
  if (u >= across) return;
  ivec3 start_cell = axis == 2u ? ivec3(row, u, 0) : axis == 1u ? ivec3(row, 0, u) : ivec3(0, row, u);
  int stride = axis == 2u ? 1 : axis == 1u ? size.z : size.y * size.z, base = int(cell_index(start_cell, size));
  int line = v * across + u, lines = int(push.rows) * across, depth = 0;
  Parabola top = Parabola(kNoVoxel, 0.0, 0.0, 0.0);
  for (int i = 0; i < count; ++i) {
    uint site = fetch(from, base + i * stride);
    bool is_site = site != kNoVoxel;
    uint valid_site = is_site ? site : 0u;
    vec3 p = vec3(voxel_of(places, valid_site) - origin) + site_point(surface_at(surface, valid_site));
    vec3 aside = p - vec3(start_cell);
    float at = axis == 2u ? p.z : axis == 1u ? p.y : p.x, over = dot(aside, aside) - at * at, start = -1.0;
    for (bool searching = is_site && depth > 0; searching;) {
      float gap = at - top.at;
      start = gap > kMinSiteGap ? 0.5 * (at + top.at + (over - top.over) / gap) : over < top.over ? -2.0 : 1e9;
      searching = start <= top.start;
      if (searching) {
        --depth;
        if (depth > 0) top = stack[(depth - 1) * lines + line];
        start = -1.0;
        searching = depth > 0;
      }
    }
    if (is_site && start < float(count)) {
      top = Parabola(site, start, at, over);
      stack[depth * lines + line] = top;
      ++depth;
    }
  }
  uint now = kNoVoxel, next = depth > 0 ? stack[line].site : kNoVoxel;
  float until = depth > 0 ? -1.0 : 1e9;
  int taken = 0;
  for (int i = 0; i < count; ++i) {
    while (until <= float(i)) {
      now = next;
      ++taken;
      Parabola other = stack[min(taken, max(depth - 1, 0)) * lines + line];
      next = other.site;
      until = taken < depth ? other.start : 1e9;
    }
    to[base + i * stride] = now;
  }
}
