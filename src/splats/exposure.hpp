// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "splats/training_view.hpp"

namespace cairn {

/// Estimates TrainingView::gain from the colors of the surface points that several views see: alternating least squares
/// of gains by view and channel and of colors by point. The mean logarithm of the gains is zero.
void estimate_gains(std::vector<TrainingView>& views, const Mesh& mesh);

}  // namespace cairn
