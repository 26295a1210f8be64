// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/radix_sort.hpp"

#include <utility>

#include "spirv/scan.comp.h"
#include "spirv/sort_count.comp.h"
#include "spirv/sort_scatter.comp.h"

namespace cairn {
namespace {

std::uint32_t chunks_of(std::uint32_t count) { return (count + shader::kSortChunk - 1) / shader::kSortChunk; }

}  // namespace

RadixSort::RadixSort(gpu::Device& device)
    : device_(device),
      count_(device, "sort_count", sort_count_comp),
      scatter_(device, "sort_scatter", sort_scatter_comp),
      scan_(device, "scan", scan_comp),
      total_(device, sizeof(std::uint32_t)) {}

void RadixSort::reserve(std::uint32_t count) {
  if (count <= reserved_) return;
  device_.wait();  // earlier batches may use the old buffer
  reserved_ = count + count / 2;
  bins_ = gpu::Buffer(device_, sizeof(std::uint32_t) * std::uint64_t{shader::kSortBins} * chunks_of(reserved_));
}

void RadixSort::sort(gpu::Batch& batch, Pairs& pairs, Pairs& scratch, std::uint32_t count, std::uint32_t bits) {
  const std::uint32_t chunks = chunks_of(count);
  if (count == 0) return;
  for (std::uint32_t shift = 0; shift < bits; shift += shader::kSortBits) {
    const shader::SortPush push{.count = count, .chunks = chunks, .shift = shift};
    count_(batch, {chunks, 1, 1}, push, {&pairs.keys, &bins_});
    scan(batch, bins_, shader::kSortBins * chunks, total_);
    scatter_(batch, {chunks, 1, 1}, push, {&pairs.keys, &pairs.values, &bins_, &scratch.keys, &scratch.values});
    std::swap(pairs, scratch);
  }
}

void RadixSort::scan(gpu::Batch& batch, const gpu::Buffer& numbers, std::uint32_t count, const gpu::Buffer& total) {
  scan_(batch, {shader::kScanGroup, 1, 1}, {.count = count}, {&numbers, &total});
}

}  // namespace cairn
