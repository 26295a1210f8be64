// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A check of camera poses against the depth images that they are for.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "cairn/frame.hpp"
#include "cairn/pose_convention.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

/// Depth images of a few stretches of a recording, about ten a second, for check_poses.
[[nodiscard]] std::vector<Frame> sampled_frames(Source& source);

/// What depth says of poses. Shares are of the points of one depth image that another one, a little later, shows where
/// the poses say.
struct PoseCheck {
  int pairs = 0;          ///< of depth images, between which the camera moved; 0: nothing can be said
  double as_given = 0;    ///< share, 0 to 1
  double motionless = 0;  ///< share, had the camera not moved
  double explained = 0;   ///< share with `likely`
  bool contradicts = false;
  PoseConvention likely;   ///< explains most; the default where nothing does
  bool is_likely = false;  ///< `likely` explains what the poses as given do not
  bool is_only = false;    ///< and no other convention comes near
};

/// Compares depth images with each other through poses, as given and in every convention that PoseConvention has.
/// `frames`: with increasing timestamps.
[[nodiscard]] PoseCheck check_poses(const Rig& rig, const std::vector<Frame>& frames, const Trajectory& poses);

/// One line: what was seen and what to do; empty where the poses are not contradicted. `option`: which gave the poses.
[[nodiscard]] std::string text_of(const PoseCheck& check, std::string_view option = "--poses");

}  // namespace cairn
