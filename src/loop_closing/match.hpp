// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Dense matching of two keyframes' surfaces.
#pragma once
#include <optional>

#include "alignment/align.hpp"
#include "cairn/mapping/options.hpp"
#include "cairn/mapping/pose_graph.hpp"
#include "graph/inflate_information.hpp"
#include "preprocess/preprocess.hpp"

namespace cairn {

constexpr std::size_t kMaxLoopCandidates = 3;  // keyframes per query to match by features
constexpr int kMinLoopInliers = 30;            // min. feature inliers for a dense alignment

struct Match {
  Eigen::Isometry3d reference_from_query = Eigen::Isometry3d::Identity();
  Matrix6d information = Matrix6d::Zero();  // inflated by inflate_information(), in the frame of the query
  double inlier_share = 0, rmse = 0;        // see Alignment
};

/// Dense point-to-plane alignment of two depth images. Geometry only, as color may not be registered to depth.
class SurfaceMatcher {
 public:
  SurfaceMatcher(gpu::Device& device, const Rig& rig, const Options& options);
  /// Sets the reference frame.
  void set_reference(const Frame& reference);
  /// Empty if the frames have too little surface in common.
  [[nodiscard]] std::optional<Match> match(const Frame& query, const Eigen::Isometry3d& guess);
  /// Also aligns in the opposite direction and requires both results to agree, for an uncertain guess. Sets the
  /// reference frame.
  [[nodiscard]] std::optional<Match> match_symmetric(const Frame& reference, const Frame& query,
                                                     const Eigen::Isometry3d& guess);

 private:
  Preprocessor first_, second_;
  Aligner aligner_;
  SurfacePrediction view_;
};

}  // namespace cairn
