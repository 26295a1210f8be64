// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stable radix sort of 32-bit keys with values, and exclusive prefix sums. A thread owns a chunk of consecutive
// elements, so that neither atomics nor subgroups are needed and the result is the same on every device.
#ifndef CAIRN_SORT_H
#define CAIRN_SORT_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

const uint kSortBits = 8;     // per pass
const uint kSortBins = 256;   // 2^kSortBits
const uint kSortChunk = 256;  // elements per thread
const uint kScanGroup = 256;  // threads of a prefix sum

struct SortPush {
  uint count;
  uint chunks;  // ceil(count / kSortChunk)
  uint shift;   // lowest bit of the pass
};
struct ScanPush {
  uint count;
};

#ifdef __cplusplus
}  // namespace cairn::shader
#endif
#endif
