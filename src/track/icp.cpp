// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "track/icp.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "spirv/icp_reduce.comp.h"

namespace cairn {
namespace {

constexpr std::uint32_t kWorkgroup = 64;
constexpr std::uint32_t kPixelsPerThread = 60;
constexpr std::uint32_t kMaxGroups = 128;
constexpr std::uint32_t kMaxSums = kMaxGroups * kWorkgroup;  // a subgroup has at least one thread
constexpr double kConverged = 1e-5;  // radians and metres: a hundredth of a pixel and of a voxel

Eigen::Isometry3d exponential(const Eigen::Matrix<double, 6, 1>& x) {
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  const double angle = x.head<3>().norm();
  if (angle > 0) t.linear() = Eigen::AngleAxisd(angle, x.head<3>() / angle).toRotationMatrix();
  t.translation() = x.tail<3>();
  return t;
}

}  // namespace

Icp::Icp(gpu::Device& device, const TrackOptions& options)
    : device_(device),
      options_(options),
      sums_(device, kMaxSums * sizeof(shader::IcpSums)),
      reduce_(device, "icp_reduce", icp_reduce_comp) {}

Icp::System Icp::linearise(const PointImage& live, const PointImage& model, const Eigen::Isometry3d& model_from_live,
                           int level) {
  const auto pixels = static_cast<std::uint32_t>(live.camera.width * live.camera.height);
  const std::uint32_t groups = std::clamp(pixels / (kWorkgroup * kPixelsPerThread), 16u, kMaxGroups);
  const std::uint32_t subgroups = kWorkgroup / device_.info().subgroup_size;
  std::vector<shader::IcpSums> sums(groups * subgroups);
  gpu::Batch batch(device_);
  reduce_(batch, {groups * kWorkgroup, 1, 1},
          {.camera = shader::pinhole(live.camera),
           .model_from_live = shader::rigid(model_from_live),
           .threads = groups * kWorkgroup,
           .max_distance = options_.max_distance * static_cast<float>(1 << level),
           .min_cosine = std::cos(options_.max_angle),
           .huber = options_.huber},
          {&live.points, &model.points, &sums_});
  batch.download(sums_, sums);
  batch.run();

  System s;
  for (const auto& p : sums) {
    s.a(0, 0) += p.rr0.x, s.a(0, 1) += p.rr0.y, s.a(0, 2) += p.rr0.z;
    s.a(1, 1) += p.rr1.x, s.a(1, 2) += p.rr1.y, s.a(2, 2) += p.rr1.z;
    s.a(0, 3) += p.rt0.x, s.a(0, 4) += p.rt0.y, s.a(0, 5) += p.rt0.z;
    s.a(1, 3) += p.rt1.x, s.a(1, 4) += p.rt1.y, s.a(1, 5) += p.rt1.z;
    s.a(2, 3) += p.rt2.x, s.a(2, 4) += p.rt2.y, s.a(2, 5) += p.rt2.z;
    s.a(3, 3) += p.tt0.x, s.a(3, 4) += p.tt0.y, s.a(3, 5) += p.tt0.z;
    s.a(4, 4) += p.tt1.x, s.a(4, 5) += p.tt1.y, s.a(5, 5) += p.tt1.z;
    s.b += (Eigen::Matrix<double, 6, 1>() << p.br.x, p.br.y, p.br.z, p.bt.x, p.bt.y, p.bt.z).finished();
    s.squared += p.squared, s.inliers += p.inliers, s.seen += p.seen, s.live += p.live;
  }
  s.a.triangularView<Eigen::StrictlyLower>() = s.a.transpose();
  return s;
}

Alignment Icp::operator()(const Surface& live, const ModelView& model, const Eigen::Isometry3d& guess) {
  Alignment result;
  Eigen::Isometry3d model_from_live = model.submap_from_camera.inverse() * guess;
  System system;
  for (int level = options_.levels - 1; level >= options_.finest_level; --level) {
    const auto l = static_cast<std::size_t>(level);
    const int most = level == options_.finest_level ? options_.iterations_finest : options_.iterations_coarse;
    for (int i = 0; i < most; ++i) {
      system = linearise(*live.levels[l], *model.levels[l], model_from_live, level);
      ++result.iterations;
      const Eigen::LDLT<Matrix6d> ldlt(system.a);
      if (system.inliers < 6 || ldlt.info() != Eigen::Success || !ldlt.isPositive() || ldlt.rcond() < 1e-12) break;
      const Eigen::Matrix<double, 6, 1> x = ldlt.solve(system.b);
      if (!x.allFinite()) break;
      model_from_live = exponential(x) * model_from_live;
      if (x.norm() < kConverged * (1 << level)) break;
    }
  }
  result.submap_from_camera = model.submap_from_camera * model_from_live;
  // Products of rotations drift away from orthonormal ones.
  result.submap_from_camera.linear() =
      Eigen::Quaterniond(result.submap_from_camera.linear()).normalized().toRotationMatrix();
  result.information = system.a;
  result.inlier_share = system.seen > 0 ? system.inliers / system.seen : 0.0;
  result.overlap = system.live > 0 ? system.seen / system.live : 0.0;
  result.rmse = system.inliers > 0 ? std::sqrt(system.squared / system.inliers) : 0.0;
  if (system.live < 0.02 * live.levels[static_cast<std::size_t>(options_.finest_level)]->camera.width *
                        live.levels[static_cast<std::size_t>(options_.finest_level)]->camera.height)
    result.lost = "too little depth";
  else if (result.overlap < 0.05)
    result.lost = "the map is out of view";
  else if (result.inlier_share < options_.min_inlier_share)
    result.lost = "too few points fit the map";
  else if (result.rmse > options_.max_rmse)
    result.lost = "points fit the map badly";
  return result;
}

}  // namespace cairn
