// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <vector>

#include "gpu/kernel.hpp"
#include "shaders/splats.h"
#include "splats/rasterizer.hpp"
#include "splats/splat_model.hpp"

namespace cairn {

/// Step sizes of Adam.
struct SplatRates {
  float position = 4e-4f;  // meters
  float scale = 5e-3f, rotation = 1e-3f, opacity = 5e-2f, color = 5e-3f, harmonics = 2.5e-4f;
};

/// Adam (Kingma & Ba 2015) on the parameters of the visible splats.
class SplatOptimizer {
 public:
  SplatOptimizer(gpu::Device& device, SplatModel model);
  [[nodiscard]] const SplatModel& model() const { return model_; }
  /// Applies the gradients of the rasterizer's last view.
  void step(const SplatRasterizer& rasterizer, const SplatRates& rates);
  /// Replaces the model by splats derived from it. `source`: by new splat, its splat in the old model, whose moments it
  /// takes.
  void replace(const Splats& splats, const std::vector<std::uint32_t>& source);

 private:
  struct Moments {
    gpu::Buffer mean, square;
  };
  void gather(gpu::Buffer& planes, std::size_t plane_count, const std::vector<std::uint32_t>& source,
              std::uint32_t old_count);

  gpu::Device& device_;
  gpu::Kernel<shader::SplatAdamPush> adam_;
  SplatModel model_;
  Moments core_, harmonics_;
  int steps_ = 0;
};

}  // namespace cairn
