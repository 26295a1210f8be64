// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Consistency check of given camera poses against the depth images.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "cairn/io/pose_convention.hpp"
#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Depth images from a few sections of a recording, about ten per second, for check_poses.
[[nodiscard]] std::vector<Frame> sampled_frames(Source& source);

/// Result of check_poses. Fractions count points of one depth image confirmed by a slightly later one at the predicted
/// position.
struct PoseCheck {
  int pairs = 0;          ///< pairs of depth images with camera motion between them; 0: no conclusion
  double as_given = 0;    ///< fraction, 0 to 1
  double motionless = 0;  ///< fraction for a static camera
  double explained = 0;   ///< fraction with `likely`
  bool contradicts = false;
  PoseConvention likely;   ///< convention with the highest fraction; the default if all fail
  bool is_likely = false;  ///< `likely` fits, the given poses do not
  bool is_only = false;    ///< `likely` fits, and no other convention fits nearly as well
};

/// Compares depth images pairwise under the given poses, and under every convention of PoseConvention. `frames`: with
/// increasing timestamps.
[[nodiscard]] PoseCheck check_poses(const Rig& rig, const std::vector<Frame>& frames, const Trajectory& poses);

/// One line with the finding and the remedy; empty if the poses are not contradicted. `option`: source of the poses.
[[nodiscard]] std::string to_string(const PoseCheck& check, std::string_view option = "--poses");

}  // namespace cairn
