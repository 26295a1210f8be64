// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/mapping/pose_graph.hpp"

namespace cairn {

/// Inflates the information of an alignment for an edge of the pose graph: neighboring points are correlated, and some
/// errors (calibration, shutter, voxels) do not average out with the number of points.
[[nodiscard]] Matrix6d inflate_information(const Matrix6d& information);

}  // namespace cairn
