// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Plain loops in double precision for the kernels of src/splats.
#pragma once
#include <vector>

#include "splats/image_loss.hpp"
#include "splats/rasterizer.hpp"

namespace cairn::twin {

/// Parameters of a splat in the order of the model's planes: position 0, log scale 3, rotation 6, opacity 10, color 11,
/// harmonics 14.
using SplatParameters = std::vector<double>;

[[nodiscard]] std::vector<SplatParameters> parameters_of(const Splats& splats);

/// Image in planes: red, green, blue, opacity, depth. Each pixel visits all splats, nearest first.
[[nodiscard]] std::vector<double> render_splats(const std::vector<SplatParameters>& splats, int degree,
                                                const SplatView& view);

/// Loss of an image in planes against a photo and the depth of a surface.
[[nodiscard]] double splat_loss(const std::vector<double>& image, int width, int height,
                                const std::vector<std::uint32_t>& color, const std::vector<float>& depth,
                                const Exposure& exposure, const LossWeights& weights);

}  // namespace cairn::twin
