// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/training_memory.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "cairn/mapping/splats.hpp"
#include "shaders/splats.h"

namespace cairn {
namespace {

constexpr double kBytesPerPixel = 8;           // color and depth
constexpr double kCopiesOfImages = 2.25;       // on the host; on the device in two sizes
constexpr double kCopiesOfSplats = 5;          // model, two moments, gradients, and the host's during a densification
constexpr double kBytesPerSplat = 100;         // of a projected splat and its keys
constexpr double kTilesPerSplat = 8;           // on average, if all splats are visible
constexpr double kBytesPerEntry = 40 + 6 * 4;  // of a splat in a tile: gradients, keys

}  // namespace

TrainingMemory training_memory(std::size_t images, const Camera& camera, std::size_t splats, int degree) {
  const double pixels = static_cast<double>(camera.width) * camera.height,
               planes = shader::kSplatPlanes + 3 * static_cast<double>(harmonics_per_splat(degree));
  return {.images = static_cast<std::uint64_t>(kCopiesOfImages * kBytesPerPixel * pixels * static_cast<double>(images)),
          .splats = static_cast<std::uint64_t>(
              (kCopiesOfSplats * planes * sizeof(float) + kBytesPerSplat + kTilesPerSplat * kBytesPerEntry) *
              static_cast<double>(splats))};
}

void expect_enough(const TrainingMemory& needed, std::uint64_t available) {
  if (available == 0 || needed.total() <= available) return;
  const auto gigabytes = [](std::uint64_t bytes) { return static_cast<double>(bytes) / (1 << 30); };
  throw std::runtime_error(fmt::format(
      "the training needs about {:.1f} GiB, {:.1f} for the images and {:.1f} for the splats, and {:.1f} GiB are free: "
      "use fewer SplatOptions::{}, or a smaller SplatOptions::resolution",
      gigabytes(needed.total()), gigabytes(needed.images), gigabytes(needed.splats), gigabytes(available),
      needed.images > needed.splats ? "images" : "max_splats"));
}

}  // namespace cairn
