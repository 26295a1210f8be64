// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <cstdint>

#include "cairn/mapping/camera.hpp"

namespace cairn {

/// Memory of a training, estimated: host and device together, which share it on a CPU or an integrated GPU.
struct TrainingMemory {
  std::uint64_t images = 0, splats = 0;  // bytes
  [[nodiscard]] std::uint64_t total() const { return images + splats; }
};

/// `camera`: of the training images. `degree`: of the harmonics.
[[nodiscard]] TrainingMemory training_memory(std::size_t images, const Camera& camera, std::size_t splats, int degree);

/// Throws std::runtime_error with the options to change if the memory exceeds `available` bytes; 0: unknown.
void expect_enough(const TrainingMemory& needed, std::uint64_t available);

}  // namespace cairn
