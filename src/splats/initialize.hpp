// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/splats.hpp"
#include "splats/training_view.hpp"

namespace cairn {

/// Surfels on a mesh: flat splats at most as dense as the pixels of the views that see them, at most `max_count`, with
/// the colors of the views.
[[nodiscard]] Splats surfels_of(const Mesh& mesh, const std::vector<TrainingView>& views, std::size_t max_count,
                                int degree);

/// Splats for the parts of an image that neither the mesh nor `image`, the rendering of the splats so far, covers:
/// background beyond the depth range and holes. Their depth is that of the nearest surface in the image.
void append_background(Splats& splats, const TrainingView& view, const SplatImage& image);

/// True if a notable part of the view shows no surface.
[[nodiscard]] bool has_background(const TrainingView& view);

}  // namespace cairn
