// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// One step of Gauss-Newton: surfels are eliminated, what is left is solved by sparse Cholesky.
#include <tbb/parallel_for.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "adjust/bundle.hpp"

namespace cairn {
namespace {

constexpr double kShare = 1 / Bundle::kTogether;            // of an observation
constexpr double kHeld = 1e12;                              // information that keeps what must not move
constexpr double kMostMove = 0.05;                          // metres of a surfel
constexpr double kClockPrior = 0.02, kReadoutPrior = 0.02;  // seconds
// A surfel that nothing holds stays.
const Eigen::Vector3d kFloor = Eigen::Vector3d(1e-2, 1e-6, 1e-6) / Bundle::kTogether;

using WithView = Eigen::Matrix<double, 3, 6>;
using WithShutter = Eigen::Matrix<double, 3, 2>;

/// Lower triangle of a symmetric matrix made of 6x6 blocks.
class Blocks {
 public:
  void add(std::size_t i, std::size_t j, const Matrix6d& block) {
    for (int r = 0; r < 6; ++r)
      for (int c = 0; c < 6; ++c) {
        const auto row = static_cast<int>(6 * i) + r, column = static_cast<int>(6 * j) + c;
        if (row >= column) triplets_.emplace_back(row, column, block(r, c));
      }
  }
  [[nodiscard]] Eigen::SparseMatrix<double> matrix(std::size_t views) const {
    const auto size = static_cast<int>(6 * views);
    Eigen::SparseMatrix<double> m(size, size);
    m.setFromTriplets(triplets_.begin(), triplets_.end());
    return m;
  }

 private:
  std::vector<Eigen::Triplet<double>> triplets_;
};

void add_ties(const std::vector<PoseGraph::Edge>& ties, const std::vector<Eigen::Isometry3d>& poses, Blocks& blocks,
              std::vector<Vector6d>& right) {
  for (const auto& tie : ties) {
    const Eigen::Isometry3d j_from_i = poses[tie.j].inverse() * poses[tie.i];
    const Vector6d off = local_coordinates(tie.i_from_j.inverse() * j_from_i.inverse());
    const Matrix6d information = Bundle::weight_of_tie(off.dot(tie.information * off)) * tie.information;
    const Matrix6d by_i = -adjoint(j_from_i), left = by_i.transpose() * information;
    blocks.add(tie.i, tie.i, left * by_i);
    blocks.add(tie.j, tie.j, information);
    if (tie.i > tie.j)
      blocks.add(tie.i, tie.j, left);
    else
      blocks.add(tie.j, tie.i, left.transpose());
    right[tie.i] -= left * off;
    right[tie.j] -= information * off;
  }
}

}  // namespace

struct Bundle::Equations {
  // By surfel: its own block, inverted, and what it shares with the shutter; by observation: with the view.
  std::vector<Eigen::Matrix3d> inverse;
  std::vector<Eigen::Vector3d> gradient;
  std::vector<WithShutter> with_shutter;
  std::vector<WithView> with_view;
  // By view: blocks with those before it (where there are some), the right side, and what it shares with the shutter.
  std::vector<std::vector<std::pair<std::size_t, Matrix6d>>> blocks;
  std::vector<Vector6d> right;
  std::vector<Eigen::Matrix<double, 6, 2>> border;
  Eigen::Matrix2d corner = Eigen::Matrix2d::Zero();
  Shutter corner_right = Shutter::Zero();
};

void Bundle::linearise_surfels(Equations& e) const {
  const std::size_t surfels = surfels_.size();
  e.inverse.resize(surfels), e.gradient.resize(surfels), e.with_shutter.resize(surfels);
  e.with_view.resize(seen_by_.size());
  tbb::parallel_for(std::size_t{0}, surfels, [&](std::size_t s) {
    Eigen::Matrix3d own = kFloor.asDiagonal();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    WithShutter shutter = WithShutter::Zero();
    Seen seen;
    for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o) {
      e.with_view[o].setZero();
      if (!look(surfels_[s], seen_by_[o], true, seen)) continue;
      for (int i = 0; i < seen.count; ++i) {
        const Residual& r = seen.residual[static_cast<std::size_t>(i)];
        const Eigen::Vector3d w = kShare * r.weight * r.by_surfel;
        own += w * r.by_surfel.transpose();
        gradient += w * r.value;
        e.with_view[o] += w * r.by_pose.transpose();
        shutter += w * r.by_shutter.transpose();
      }
    }
    e.inverse[s] = own.inverse(), e.gradient[s] = gradient, e.with_shutter[s] = shutter;
  });
}

Bundle::Equations Bundle::eliminate_surfels() const {
  const std::size_t views = views_.size(), surfels = surfels_.size();
  Equations e;
  linearise_surfels(e);
  std::vector<std::vector<std::pair<std::uint32_t, std::uint32_t>>> by_view(views);  // surfel, observation
  for (std::size_t s = 0; s < surfels; ++s)
    for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o)
      by_view[seen_by_[o]].emplace_back(static_cast<std::uint32_t>(s), o);

  e.blocks.resize(views);
  e.right.assign(views, Vector6d::Zero());
  e.border.assign(views, Eigen::Matrix<double, 6, 2>::Zero());
  std::vector<Eigen::Matrix2d> corners(views, Eigen::Matrix2d::Zero());
  std::vector<Shutter> corner_rights(views, Shutter::Zero());
  tbb::parallel_for(std::size_t{0}, views, [&](std::size_t k) {
    std::vector<Matrix6d> row(k + 1, Matrix6d::Zero());
    std::vector<bool> is_used(k + 1, false);
    is_used[k] = true;
    Seen seen;
    for (const auto& [s, o] : by_view[k]) {
      if (look(surfels_[s], k, true, seen))
        for (int i = 0; i < seen.count; ++i) {
          const Residual& r = seen.residual[static_cast<std::size_t>(i)];
          const double weight = kShare * r.weight;
          row[k] += weight * r.by_pose * r.by_pose.transpose();
          e.right[k] -= weight * r.value * r.by_pose;
          e.border[k] += weight * r.by_pose * r.by_shutter.transpose();
          corners[k] += weight * r.by_shutter * r.by_shutter.transpose();
          corner_rights[k] -= weight * r.value * r.by_shutter;
        }
      const Eigen::Matrix<double, 6, 3> eliminated = e.with_view[o].transpose() * e.inverse[s];
      e.right[k] += eliminated * e.gradient[s];
      e.border[k] -= eliminated * e.with_shutter[s];
      for (std::uint32_t other = first_[s]; other <= o; ++other) {
        row[seen_by_[other]].noalias() -= eliminated * e.with_view[other];
        is_used[seen_by_[other]] = true;
      }
    }
    for (std::size_t j = 0; j <= k; ++j)
      if (is_used[j]) e.blocks[k].emplace_back(j, row[j]);
  });
  for (std::size_t k = 0; k < views; ++k) e.corner += corners[k], e.corner_right += corner_rights[k];
  for (std::size_t s = 0; s < surfels; ++s) {
    const Eigen::Matrix<double, 2, 3> eliminated = e.with_shutter[s].transpose() * e.inverse[s];
    e.corner -= eliminated * e.with_shutter[s];
    e.corner_right += eliminated * e.gradient[s];
  }
  return e;
}

void Bundle::move_surfels(const Equations& e, const Eigen::VectorXd& pose_steps, const Shutter& shutter_step) {
  tbb::parallel_for(std::size_t{0}, surfels_.size(), [&](std::size_t s) {
    Eigen::Vector3d g = e.gradient[s] + e.with_shutter[s] * shutter_step;
    for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o)
      g += e.with_view[o] * pose_steps.segment<6>(static_cast<int>(6 * seen_by_[o]));
    const Eigen::Vector3d move = -e.inverse[s] * g;
    surfels_[s].position += std::clamp(move[0], -kMostMove, kMostMove) * surfels_[s].normal;
    surfels_[s].brightness_beside += move.tail<2>();
  });
}

/// Levenberg-Marquardt: a step that does not help is taken back, and the next one is shorter.
void Bundle::step(double& damping, double& last) {
  const std::size_t views = views_.size();
  Equations e = eliminate_surfels();
  Blocks blocks;
  for (std::size_t k = 0; k < views; ++k)
    for (const auto& [j, block] : e.blocks[k]) {
      blocks.add(k, j, block);
      if (j != k) continue;
      Matrix6d damp = Matrix6d::Zero();
      damp.diagonal() = damping * block.diagonal().cwiseAbs() + Vector6d::Constant(k == 0 ? kHeld : 1e-3);
      blocks.add(k, k, damp);
    }
  add_ties(ties_, poses_, blocks, e.right);
  const Shutter now(shutter_.clock, shutter_.readout);
  const Shutter prior(1 / (kClockPrior * kClockPrior), finds_readout_ ? 1 / (kReadoutPrior * kReadoutPrior) : kHeld);
  e.corner.diagonal() += prior;
  e.corner_right -= prior.cwiseProduct(now);

  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver(blocks.matrix(views));
  if (solver.info() != Eigen::Success) {
    damping = std::max(1e-4, 10 * damping);
    return;
  }
  Eigen::MatrixXd right(static_cast<int>(6 * views), 3);
  for (std::size_t k = 0; k < views; ++k) {
    right.block<6, 1>(static_cast<int>(6 * k), 0) = e.right[k];
    right.block<6, 2>(static_cast<int>(6 * k), 1) = e.border[k];
  }
  const Eigen::MatrixXd solved = solver.solve(right);
  const Eigen::Matrix2d shutter_information = e.corner - right.rightCols(2).transpose() * solved.rightCols(2);
  const Shutter shutter_step =
      shutter_information.ldlt().solve(Shutter(e.corner_right - right.rightCols(2).transpose() * solved.col(0)));
  const Eigen::VectorXd pose_steps = solved.col(0) - solved.rightCols(2) * shutter_step;

  const auto poses = poses_;
  const auto surfels = surfels_;
  const BundleShutter shutter = shutter_;
  for (std::size_t k = 0; k < views; ++k)
    poses_[k] = poses_[k] * retract(pose_steps.segment<6>(static_cast<int>(6 * k)));
  shutter_.clock += shutter_step[0], shutter_.readout += shutter_step[1];
  move_surfels(e, pose_steps, shutter_step);
  if (const double after = cost(); after < last) {
    last = after;
    damping = std::max(1e-7, 0.2 * damping);
    readout_sigma_ = std::sqrt(shutter_information.inverse()(1, 1));
    return;
  }
  poses_ = poses, surfels_ = surfels, shutter_ = shutter;
  damping = std::max(1e-5, 10 * damping);
}

}  // namespace cairn
