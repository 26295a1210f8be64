// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Covariance of a bundle adjustment. The inverse of the normal equations gives the relative uncertainty of directions.
// Its scale, the variance factor, is measured, since no model describes the correlation of neighbors' noise. The
// influence of a place is the change of the poses by its part of the gradient at the optimum. Influences of all places
// nearly cancel; those of different places are independent errors (a cluster-robust variance: Liang & Zeger 1986).
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "bundle/bundle_equations.hpp"

namespace cairn {
namespace {

constexpr double kPlaceSize = 0.5;  // m; errors within a place are correlated
// Standard deviations of a view in exact images, about and along each axis, added to the others (RMS over five
// sequences as in the test Bundle.KeepsExactPoses).
constexpr double kMinRotationSigma = 1.7e-5, kMinTranslationSigma = 3.6e-5;  // rad, m
constexpr std::size_t kParts = 4;           // partial sums over places, added in a fixed order on every machine
constexpr std::size_t kViewsPerSolve = 32;  // views

}  // namespace

struct Bundle::ByPlace {
  Equations equations;
  /// Contribution of each place to the right-hand side, one column per place: poses, then shared unknowns.
  Eigen::MatrixXd right;
  /// Contribution of each place to the information of its views.
  struct OfView {
    std::size_t view;
    Matrix6d information;
  };
  std::vector<std::vector<OfView>> of_views;
};

Bundle::ByPlace Bundle::linearize_by_places() const {
  std::map<std::array<int, 3>, std::vector<std::size_t>> all;
  for (std::size_t s = 0; s < surfels_.size(); ++s) {
    const Eigen::Vector3i cell = (surfels_[s].position / kPlaceSize).array().floor().cast<int>();
    all[{cell.x(), cell.y(), cell.z()}].push_back(s);
  }
  std::vector<std::vector<std::size_t>> places;
  places.reserve(all.size());
  for (auto& [cell, surfels] : all) places.push_back(std::move(surfels));
  ByPlace by{.equations = no_equations(), .right = {}, .of_views = {}};
  Equations& e = by.equations;
  by.right.setZero(6 * static_cast<Eigen::Index>(views_.size()) + e.reduced.corner.cols(),
                   static_cast<Eigen::Index>(places.size()));
  by.of_views.resize(places.size());
  const auto views_of = [&](const std::vector<std::size_t>& surfels) {
    std::vector<std::uint32_t> views;
    for (const std::size_t s : surfels)
      views.insert(views.end(), seen_by_.begin() + first_[s], seen_by_.begin() + first_[s + 1]);
    std::sort(views.begin(), views.end());
    views.erase(std::unique(views.begin(), views.end()), views.end());
    return views;
  };
  const auto pairs_among = [&](const std::vector<std::uint32_t>& views) {
    std::vector<std::uint32_t> pairs;
    for (std::size_t a = 0; a < views.size(); ++a)
      for (std::size_t b = 0; b <= a; ++b)
        if (const std::uint32_t pair = pair_of_[number_of(views[a], views[b])]; pair != kNoPair) pairs.push_back(pair);
    return pairs;
  };
  std::vector<Part> parts(kParts, e.reduced);
  tbb::parallel_for(std::size_t{0}, kParts, [&](std::size_t p) {
    Part place = e.reduced;  // cleared after each place
    for (std::size_t i = p * places.size() / kParts; i < (p + 1) * places.size() / kParts; ++i) {
      for (const std::size_t s : places[i]) linearize(s, e, place);
      const std::vector<std::uint32_t> views = views_of(places[i]);
      auto column = by.right.col(static_cast<Eigen::Index>(i));
      for (const std::uint32_t k : views) {
        column.segment<6>(static_cast<Eigen::Index>(6) * k) = place.right[k];
        const Matrix6d& own = place.blocks[pair_of_[number_of(k, k)]];
        if (!own.isZero()) by.of_views[i].push_back({k, own});
      }
      column.tail(place.corner_right.size()) = place.corner_right;
      parts[p].take(place, views, pairs_among(views));
    }
  });
  for (const Part& part : parts) e.reduced.add(part);
  add_priors(e);
  return by;
}

/// Covariance of views and steps; surfels are added by the caller.
BundleCovariance Bundle::covariance_of_views(const Solver& solver) const {
  BundleCovariance all{.of_views = std::vector<Matrix6d>(views_.size()),
                       .of_steps = std::vector<Matrix6d>(views_.size(), Matrix6d::Zero()),
                       .of_surfels = {}};
  // Pose uncertainty due to the shared unknowns.
  const Eigen::MatrixXd root = solver.shared.matrixL().solve(solver.solved.transpose());
  // Solves a few views at a time, sequentially: CHOLMOD has one workspace.
  for (std::size_t begin = 0; begin < views_.size(); begin += kViewsPerSolve) {
    const std::size_t end = std::min(begin + kViewsPerSolve, views_.size());
    const auto first = static_cast<Eigen::Index>(6 * begin), count = static_cast<Eigen::Index>(6 * (end - begin));
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(solver.border.rows(), count);
    unit.middleRows(first, count).setIdentity();
    const Eigen::MatrixXd inverse = solver.poses.solve(unit);
    for (std::size_t k = begin; k < end; ++k) {
      const auto row = static_cast<Eigen::Index>(6 * k);
      const auto with = [&](Eigen::Index other) {
        return Matrix6d(inverse.block<6, 6>(other, row - first) +
                        root.middleCols<6>(other).transpose().lazyProduct(root.middleCols<6>(row)));
      };
      all.of_views[k] = with(row);
      if (k == 0) continue;
      const Matrix6d by_before = adjoint(poses_[k].inverse() * poses_[k - 1]), both = by_before * with(row - 6);
      all.of_steps[k] =
          all.of_views[k] + by_before * all.of_views[k - 1] * by_before.transpose() - both - both.transpose();
    }
  }
  return all;
}

/// Variance factor: mean squared influence of the places, normalized by the covariance that follows from the weights.
double Bundle::variance_factor(const ByPlace& by, const Solver& solver, const std::vector<Matrix6d>& covariance) const {
  const Eigen::MatrixXd of_poses = by.right.topRows(solver.border.rows());
  Eigen::MatrixXd of_shared = by.right.bottomRows(solver.border.cols()) - solver.solved.transpose() * of_poses;
  solver.shared.solveInPlace(of_shared);
  const Eigen::MatrixXd influences = solver.poses.solve(of_poses) - solver.solved * of_shared;
  double squared = 0;
  for (std::size_t k = 1; k < views_.size(); ++k) {
    const Eigen::MatrixXd of_view = influences.middleRows<6>(static_cast<Eigen::Index>(6 * k));
    squared += of_view.cwiseProduct(covariance[k].ldlt().solve(of_view)).sum();
  }
  // The poses already follow each place in part, which reduces its visible influence.
  double own_part = 0;
  for (const auto& place : by.of_views)
    for (const auto& [k, information] : place) {
      if (k == 0) continue;
      const Matrix6d share = by.equations.reduced.blocks[pair_of_[number_of(k, k)]].ldlt().solve(information);
      own_part += (share * share).trace();
    }
  const double unknowns = 6 * static_cast<double>(views_.size() - 1);
  return squared / std::max(1.0, unknowns - own_part);
}

std::optional<BundleCovariance> Bundle::covariance() const {
  if (surfels_.empty()) return std::nullopt;
  const ByPlace by = linearize_by_places();
  const Solver solver(*this, by.equations, 0);
  if (!solver.has_solution) return std::nullopt;
  BundleCovariance all = covariance_of_views(solver);
  const double factor = variance_factor(by, solver, all.of_views);
  Vector6d min_variances;
  min_variances << Eigen::Vector3d::Constant(kMinRotationSigma * kMinRotationSigma),
      Eigen::Vector3d::Constant(kMinTranslationSigma * kMinTranslationSigma);
  for (std::size_t k = 1; k < views_.size(); ++k) {
    for (auto* of : {&all.of_views, &all.of_steps}) {
      (*of)[k] *= factor;
      (*of)[k].diagonal() += min_variances;
    }
  }
  all.of_surfels.resize(surfels_.size());
  tbb::parallel_for(std::size_t{0}, surfels_.size(), [&, &inverse = by.equations.inverse](std::size_t s) {
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
    // Pose errors of a surfel's views are independent.
    all.of_surfels[s] = {surfel.position, inverse[s](0, 0) / kCorrelatedObservations, of_poses};
  });
  return all;
}

}  // namespace cairn
