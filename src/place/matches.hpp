// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <opencv2/core.hpp>
#include <vector>

#include "place/features.hpp"

namespace cairn {

/// Corners that two views share.
struct Matches {
  std::vector<cv::Point3d> points;  // of the known view, metres
  std::vector<cv::Point2d> rays;    // of the seen one, at z = 1
};

/// Mutual nearest descriptors, of equally near ones the first, where the known corner has depth: what cv::BFMatcher
/// finds, in a fifteenth of its time.
[[nodiscard]] Matches match(const Features& known, const Features& seen);

}  // namespace cairn
