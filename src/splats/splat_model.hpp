// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/mapping/splats.hpp"
#include "gpu/batch.hpp"

namespace cairn {

/// Splats on the device, in the planes of shaders/splats.h.
struct SplatModel {
  std::uint32_t count = 0;   // splats; the stride of the planes
  std::uint32_t degree = 0;  // of the harmonics
  gpu::Buffer core;          // shader::kSplatPlanes planes
  gpu::Buffer harmonics;     // 3 planes per harmonic; a single word for degree 0
};

/// Number of splats that a buffer bound by a kernel can hold.
[[nodiscard]] std::size_t max_splats(const gpu::Device& device, int degree);

/// Throws std::runtime_error for more splats than the device can hold.
[[nodiscard]] SplatModel upload(gpu::Device& device, const Splats& splats);
[[nodiscard]] Splats download(gpu::Device& device, const SplatModel& model);

}  // namespace cairn
