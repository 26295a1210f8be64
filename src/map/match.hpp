// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Whether and how two keyframes see the same surface.
#pragma once
#include <optional>

#include "cairn/options.hpp"
#include "cairn/pose_graph.hpp"
#include "surface/preprocess.hpp"
#include "track/align.hpp"

namespace cairn {

constexpr std::size_t kCandidates = 3;  // keyframes that one is compared with by corners
constexpr int kLoopCorners = 30;        // that must agree before two keyframes are aligned

/// The information of an alignment as an edge of the pose graph carries it: neighbouring points go together, and part
/// of the noise (calibration, shutter, voxels) no number of points averages out.
[[nodiscard]] Matrix6d calibrated(const Matrix6d& information);

struct Match {
  Eigen::Isometry3d i_from_j = Eigen::Isometry3d::Identity();
  Matrix6d information = Matrix6d::Zero();  // calibrated, in the frame of `to`
  double inlier_share = 0, rmse = 0;        // see Alignment
};

/// Dense alignment of two depth images, point to plane, by geometry alone: colour may not be registered to depth.
class SurfaceMatcher {
 public:
  SurfaceMatcher(gpu::Device& device, const Rig& rig, const Options& options);
  /// Chooses the frame that others are aligned with.
  void set_from(const Frame& from);
  /// Nothing where too little of both is the same surface.
  [[nodiscard]] std::optional<Match> match(const Frame& to, const Eigen::Isometry3d& guess);
  /// Aligns also the other way round and asks that both agree: for a guess that may be false. Chooses `from`.
  [[nodiscard]] std::optional<Match> both_ways(const Frame& from, const Frame& to, const Eigen::Isometry3d& guess);

 private:
  Preprocessor first_, second_;
  Aligner aligner_;
  SurfacePrediction view_;
};

}  // namespace cairn
