// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Dense matching of two keyframes' surfaces.
#pragma once
#include <optional>

#include "cairn/options.hpp"
#include "cairn/pose_graph.hpp"
#include "surface/preprocess.hpp"
#include "track/align.hpp"

namespace cairn {

constexpr std::size_t kCandidates = 3;  // keyframes per query to match by features
constexpr int kLoopCorners = 30;        // min. feature inliers for a dense alignment

/// Inflates the information of an alignment for an edge of the pose graph: neighboring points are correlated, and some
/// errors (calibration, shutter, voxels) do not average out with the number of points.
[[nodiscard]] Matrix6d calibrated(const Matrix6d& information);

struct Match {
  Eigen::Isometry3d i_from_j = Eigen::Isometry3d::Identity();
  Matrix6d information = Matrix6d::Zero();  // inflated by calibrated(), in the frame of `to`
  double inlier_share = 0, rmse = 0;        // see Alignment
};

/// Dense point-to-plane alignment of two depth images. Geometry only, as color may not be registered to depth.
class SurfaceMatcher {
 public:
  SurfaceMatcher(gpu::Device& device, const Rig& rig, const Options& options);
  /// Sets the reference frame.
  void set_from(const Frame& from);
  /// Empty if the frames have too little surface in common.
  [[nodiscard]] std::optional<Match> match(const Frame& to, const Eigen::Isometry3d& guess);
  /// Also aligns in the opposite direction and requires both results to agree, for an uncertain guess. Sets the
  /// reference frame.
  [[nodiscard]] std::optional<Match> both_ways(const Frame& from, const Frame& to, const Eigen::Isometry3d& guess);

 private:
  Preprocessor first_, second_;
  Aligner aligner_;
  SurfacePrediction view_;
};

}  // namespace cairn
