// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Moves keys and values to their positions by one digit, in order within a chunk, hence stable.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/sort.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SortPush push; };
layout(binding = 0, scalar) readonly buffer Keys { uint keys[]; };
layout(binding = 1, scalar) readonly buffer Values { uint values[]; };
layout(binding = 2, scalar) buffer Bins { uint bins[]; };  // next position
layout(binding = 3, scalar) writeonly buffer SortedKeys { uint sorted_keys[]; };
layout(binding = 4, scalar) writeonly buffer SortedValues { uint sorted_values[]; };

void main() {
  uint chunk = thread_index(), chunks = push.chunks, shift = push.shift;
  if (chunk >= chunks) return;
  uint end = min((chunk + 1u) * kSortChunk, push.count);
  for (uint i = chunk * kSortChunk; i < end; ++i) {
    uint key = keys[i], bin = (key >> shift & (kSortBins - 1u)) * chunks + chunk, to = bins[bin];
    bins[bin] = to + 1u;
    sorted_keys[to] = key;
    sorted_values[to] = values[i];
  }
}
