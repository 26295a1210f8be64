// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>

#include "gpu/kernel.hpp"
#include "shaders/sort.h"

namespace cairn {

/// Stable sort of 32-bit keys with 32-bit values (LSD radix sort), and exclusive prefix sums, on the device.
class RadixSort {
 public:
  explicit RadixSort(gpu::Device& device);

  /// Allocates memory for up to `count` pairs or numbers. Not between recording and submission of a batch.
  void reserve(std::uint32_t count);
  /// Keys and values; sized by the caller to at least `count` words each. Swapped with the scratch pair by each pass.
  struct Pairs {
    gpu::Buffer keys, values;
  };
  /// Sorts the first `count` pairs, at most as many as reserved, by the lowest `bits` of their keys. `scratch` has the
  /// same size as `pairs`.
  void sort(gpu::Batch& batch, Pairs& pairs, Pairs& scratch, std::uint32_t count, std::uint32_t bits);
  /// Replaces numbers by the sums of all numbers before them. `total`: a word, their sum.
  void scan(gpu::Batch& batch, const gpu::Buffer& numbers, std::uint32_t count, const gpu::Buffer& total);

 private:
  gpu::Device& device_;
  gpu::Kernel<shader::SortPush> count_, scatter_;
  gpu::Kernel<shader::ScanPush> scan_;
  std::uint32_t reserved_ = 0;  // pairs
  gpu::Buffer bins_, total_;
};

}  // namespace cairn
