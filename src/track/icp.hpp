// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <string>

#include "cairn/options.hpp"
#include "shaders/track.h"
#include "surface/preprocess.hpp"
#include "volume/raycast.hpp"

namespace cairn {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct Alignment {
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  Matrix6d information = Matrix6d::Zero();  // of (rotation, translation) in the model view's frame; 1/rad^2, 1/m^2
  double inlier_share = 0.0;                // of the live points that see the model
  double overlap = 0.0;                     // share of the live points that see the model
  double rmse = 0.0;                        // of the inliers, in standard deviations of the depth noise
  int iterations = 0;                       // over all levels
  std::string lost;                         // why the pose is not to be trusted; empty: converged
  [[nodiscard]] bool converged() const { return lost.empty(); }
};

/// Coarse-to-fine projective point-to-plane ICP of a live surface against the model.
class Icp {
 public:
  Icp(gpu::Device& device, const TrackOptions& options);
  [[nodiscard]] Alignment operator()(const Surface& live, const ModelView& model, const Eigen::Isometry3d& guess);

 private:
  struct System {
    Matrix6d a = Matrix6d::Zero();
    Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
    double squared = 0, inliers = 0, seen = 0, live = 0;
  };
  System linearise(const PointImage& live, const PointImage& model, const Eigen::Isometry3d& model_from_live,
                   int level);

  gpu::Device& device_;
  TrackOptions options_;
  gpu::Buffer sums_;
  gpu::Kernel<shader::IcpReducePush> reduce_;
};

}  // namespace cairn
