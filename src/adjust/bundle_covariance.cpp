// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// How surely a bundle knows what it adjusted. The inverse of the normal equations tells which directions are known
// better than others; by how much all of them err is measured, since noise of neighbours is alike by an amount that no
// model tells: at the end the scene's places pull views to where each would have them, and these pulls are errors that
// do not know of each other (a cluster-robust variance: Liang & Zeger 1986).
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "adjust/bundle_equations.hpp"

namespace cairn {
namespace {

constexpr double kPlace = 0.5;     // metres; what lies together errs alike
constexpr std::size_t kParts = 4;  // sums of places, added up in this order on every machine

}  // namespace

/// The equations, and what each place adds to their right side: poses, then what all share; a column for each.
std::pair<Bundle::Equations, Eigen::MatrixXd> Bundle::linearise_by_places() const {
  std::map<std::array<int, 3>, std::vector<std::size_t>> all;
  for (std::size_t s = 0; s < surfels_.size(); ++s) {
    const Eigen::Vector3i cell = (surfels_[s].position / kPlace).array().floor().cast<int>();
    all[{cell.x(), cell.y(), cell.z()}].push_back(s);
  }
  std::vector<std::vector<std::size_t>> places;
  for (auto& [cell, surfels] : all) places.push_back(std::move(surfels));
  Equations e = no_equations();
  const Eigen::Index of_poses = 6 * static_cast<Eigen::Index>(views_.size());
  Eigen::MatrixXd right(of_poses + e.reduced.corner.cols(), places.size());
  const Part none = e.reduced;
  std::vector<Part> parts(kParts, none);
  tbb::parallel_for(std::size_t{0}, kParts, [&](std::size_t p) {
    for (std::size_t i = p * places.size() / kParts; i < (p + 1) * places.size() / kParts; ++i) {
      Part place = none;
      for (const std::size_t s : places[i]) linearise(s, e, place);
      auto column = right.col(static_cast<Eigen::Index>(i));
      for (std::size_t k = 0; k < views_.size(); ++k)
        column.segment<6>(static_cast<Eigen::Index>(6 * k)) = place.right[k];
      column.tail(place.corner_right.size()) = place.corner_right;
      parts[p].add(place);
    }
  });
  for (const Part& part : parts) e.reduced.add(part);
  add_priors(e);
  return {std::move(e), std::move(right)};
}

std::vector<Matrix6d> Bundle::covariance_of_views(const Solver& solver, const Eigen::MatrixXd& by_place) const {
  std::vector<Matrix6d> covariance(views_.size());
  // What poses err by because of what all share.
  const Eigen::MatrixXd root = solver.shared.matrixL().solve(solver.solved.transpose());
  tbb::parallel_for(std::size_t{0}, views_.size(), [&](std::size_t k) {
    const auto row = static_cast<Eigen::Index>(6 * k);
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(solver.border.rows(), 6);
    unit.middleRows<6>(row).setIdentity();
    covariance[k] = solver.poses.solve(unit).middleRows<6>(row);
    covariance[k].noalias() += root.middleCols<6>(row).transpose() * root.middleCols<6>(row);
  });
  const Eigen::MatrixXd of_poses = by_place.topRows(solver.border.rows());
  const Eigen::MatrixXd pulls =
      solver.pose_steps(of_poses, solver.shared_steps(of_poses, by_place.bottomRows(solver.border.cols())));
  double squared = 0;  // in units of the covariance
  for (std::size_t k = 1; k < views_.size(); ++k) {
    const Eigen::MatrixXd of_view = pulls.middleRows<6>(static_cast<Eigen::Index>(6 * k));
    squared += of_view.cwiseProduct(covariance[k].ldlt().solve(of_view)).sum();
  }
  const double scale = squared / (6 * static_cast<double>(views_.size() - 1));
  for (Matrix6d& c : covariance) c *= scale;
  return covariance;
}

std::optional<BundleCovariance> Bundle::covariance() const {
  if (surfels_.empty()) return std::nullopt;
  const auto [e, by_place] = linearise_by_places();
  const Solver solver(*this, e, 0);
  if (!solver.has_solution) return std::nullopt;
  BundleCovariance all{.of_views = covariance_of_views(solver, by_place), .of_surfels = {}};
  all.of_surfels.resize(surfels_.size());
  tbb::parallel_for(std::size_t{0}, surfels_.size(), [&, &inverse = e.inverse](std::size_t s) {
    const Surfel& surfel = surfels_[s];
    const std::uint32_t begin = first_[s], end = first_[s + 1];
    double of_poses = 0;
    for (std::uint32_t o = begin; o < end; ++o) {
      const std::size_t k = seen_by_[o];
      const Eigen::Matrix3d camera_from_world = poses_[k].linear().transpose();
      const Eigen::Vector3d n = camera_from_world * surfel.normal;
      Vector6d by_pose;
      by_pose << (camera_from_world * (surfel.position - poses_[k].translation())).cross(n), n;
      of_poses += by_pose.dot(all.of_views[k] * by_pose) / (end - begin);
    }
    // Of one surfel's views each errs for itself.
    all.of_surfels[s] = {surfel.position, inverse[s](0, 0) / kTogether, of_poses};
  });
  return all;
}

}  // namespace cairn
