// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Exclusive prefix sum in place, and the total. One workgroup; each thread owns a range of consecutive numbers. A second
// level of workgroups would save less than its dispatches cost on a CPU device.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/sort.h"
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform Push { ScanPush push; };
layout(binding = 0, scalar) buffer Numbers { uint numbers[]; };
layout(binding = 1, scalar) writeonly buffer Total { uint total; };
shared uint sums[kScanGroup];

void main() {
  uint thread = gl_LocalInvocationID.x, each = (push.count + kScanGroup - 1u) / kScanGroup,
       begin = min(thread * each, push.count), end = min(begin + each, push.count), sum = 0u;
  for (uint i = begin; i < end; ++i) sum += numbers[i];
  sums[thread] = sum;
  barrier();
  uint before = 0u;
  for (uint i = 0u; i < thread; ++i) before += sums[i];
  for (uint i = begin; i < end; ++i) {
    uint number = numbers[i];
    numbers[i] = before;
    before += number;
  }
  if (thread == kScanGroup - 1u) total = before;
}
