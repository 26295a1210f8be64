// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Histogram of a digit by chunk, bin-major: its exclusive prefix sum is the position of each chunk's first key of a bin.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/sort.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SortPush push; };
layout(binding = 0, scalar) readonly buffer Keys { uint keys[]; };
layout(binding = 1, scalar) buffer Bins { uint bins[]; };

void main() {
  uint chunk = thread_index(), chunks = push.chunks, shift = push.shift;
  if (chunk >= chunks) return;
  for (uint bin = 0u; bin < kSortBins; ++bin) bins[bin * chunks + chunk] = 0u;
  uint end = min((chunk + 1u) * kSortChunk, push.count);
  for (uint i = chunk * kSortChunk; i < end; ++i) ++bins[(keys[i] >> shift & (kSortBins - 1u)) * chunks + chunk];
}
