// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <opencv2/core.hpp>
#include <vector>

#include "place/features.hpp"

namespace cairn {

/// Feature matches between two views.
struct Matches {
  std::vector<cv::Point3d> points;  // of the known view, meters
  std::vector<cv::Point2d> rays;    // of the seen view, at z = 1
};

/// Mutual nearest descriptors, the first of equally near ones, if the known corner has depth. The result equals
/// cv::BFMatcher's, in a fifteenth of the time.
[[nodiscard]] Matches match(const Features& known, const Features& seen);

}  // namespace cairn
