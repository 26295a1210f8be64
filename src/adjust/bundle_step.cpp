// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Steps of Gauss-Newton: surfels are eliminated, what is left is solved by sparse Cholesky.
#include <tbb/parallel_for.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "adjust/bundle.hpp"

namespace cairn {
namespace {

constexpr double kShare = 1 / Bundle::kTogether;  // of an observation
constexpr int kSteps = 3;                         // in a round
constexpr std::size_t kParts = 16;                // sums of surfels, added up in this order on every machine
constexpr std::uint32_t kNoPair = ~0u;
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

/// What surfels add to the reduced system.
struct Bundle::Part {
  std::vector<Matrix6d> blocks;  // by pair of views
  std::vector<Vector6d> right;   // by view
  std::vector<Eigen::Matrix<double, 6, 2>> border;
  Eigen::Matrix2d corner = Eigen::Matrix2d::Zero();
  Shutter corner_right = Shutter::Zero();
  Cost cost;

  Part(std::size_t pairs, std::size_t views)
      : blocks(pairs, Matrix6d::Zero()),
        right(views, Vector6d::Zero()),
        border(views, Eigen::Matrix<double, 6, 2>::Zero()) {}
  void add(const Part& other) {
    for (std::size_t i = 0; i < blocks.size(); ++i) blocks[i] += other.blocks[i];
    for (std::size_t i = 0; i < right.size(); ++i) right[i] += other.right[i], border[i] += other.border[i];
    corner += other.corner, corner_right += other.corner_right;
    cost.add(other.cost);
  }
};

struct Bundle::Equations {
  // By surfel: its own block, inverted, and what it shares with the shutter; by observation: with the view.
  std::vector<Eigen::Matrix3d> inverse;
  std::vector<Eigen::Vector3d> gradient;
  std::vector<WithShutter> with_shutter;
  std::vector<WithView> with_view;
  Part reduced;
  double cost = 0;
};

void Bundle::find_pairs() {
  const std::size_t views = views_.size();
  const auto number = [](std::size_t k, std::size_t j) { return k * (k + 1) / 2 + j; };
  pair_of_.assign(number(views, 0), kNoPair);
  for (std::size_t k = 0; k < views; ++k) pair_of_[number(k, k)] = 0;
  for (std::size_t s = 0; s < surfels_.size(); ++s)
    for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o)
      for (std::uint32_t other = first_[s]; other < o; ++other) pair_of_[number(seen_by_[o], seen_by_[other])] = 0;
  pairs_.clear();
  for (std::size_t k = 0; k < views; ++k)
    for (std::size_t j = 0; j <= k; ++j) {
      if (pair_of_[number(k, j)] == kNoPair) continue;
      pair_of_[number(k, j)] = static_cast<std::uint32_t>(pairs_.size());
      pairs_.emplace_back(static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(j));
    }
}

void Bundle::linearise(std::size_t s, Equations& e, Part& part) const {
  const auto number = [](std::size_t k, std::size_t j) { return k * (k + 1) / 2 + j; };
  Eigen::Matrix3d own = kFloor.asDiagonal();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  WithShutter with_shutter = WithShutter::Zero();
  Seen seen;
  for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o) {
    const std::size_t k = seen_by_[o];
    WithView with_view = WithView::Zero();
    if (look(surfels_[s], k, true, seen)) {
      part.cost.add(*this, seen);
      Matrix6d& block = part.blocks[pair_of_[number(k, k)]];
      for (int i = 0; i < seen.count; ++i) {
        const Residual& r = seen.residual[static_cast<std::size_t>(i)];
        const double weight = kShare * r.weight;
        const Vector6d by_pose = weight * r.by_pose;
        const Eigen::Vector3d by_surfel = weight * r.by_surfel;
        block.noalias() += by_pose * r.by_pose.transpose();
        part.right[k] -= r.value * by_pose;
        part.border[k].noalias() += by_pose * r.by_shutter.transpose();
        part.corner.noalias() += weight * r.by_shutter * r.by_shutter.transpose();
        part.corner_right -= weight * r.value * r.by_shutter;
        own.noalias() += by_surfel * r.by_surfel.transpose();
        gradient += r.value * by_surfel;
        with_view.noalias() += by_surfel * r.by_pose.transpose();
        with_shutter.noalias() += by_surfel * r.by_shutter.transpose();
      }
    }
    e.with_view[o] = with_view;
  }
  const Eigen::Matrix3d inverse = own.inverse();
  e.inverse[s] = inverse, e.gradient[s] = gradient, e.with_shutter[s] = with_shutter;
  for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o) {
    const std::size_t k = seen_by_[o];
    const Eigen::Matrix<double, 6, 3> eliminated = e.with_view[o].transpose() * inverse;
    part.right[k].noalias() += eliminated * gradient;
    part.border[k].noalias() -= eliminated * with_shutter;
    for (std::uint32_t other = first_[s]; other <= o; ++other)
      part.blocks[pair_of_[number(k, seen_by_[other])]].noalias() -= eliminated * e.with_view[other];
  }
  const Eigen::Matrix<double, 2, 3> eliminated = with_shutter.transpose() * inverse;
  part.corner.noalias() -= eliminated * with_shutter;
  part.corner_right.noalias() += eliminated * gradient;
}

Bundle::Equations Bundle::linearise() const {
  const std::size_t surfels = surfels_.size();
  Equations e{.inverse = std::vector<Eigen::Matrix3d>(surfels),
              .gradient = std::vector<Eigen::Vector3d>(surfels),
              .with_shutter = std::vector<WithShutter>(surfels),
              .with_view = std::vector<WithView>(seen_by_.size()),
              .reduced = {pairs_.size(), views_.size()}};
  std::vector<Part> parts(kParts, e.reduced);
  tbb::parallel_for(std::size_t{0}, kParts, [&](std::size_t p) {
    for (std::size_t s = p * surfels / kParts; s < (p + 1) * surfels / kParts; ++s) linearise(s, e, parts[p]);
  });
  for (const Part& part : parts) e.reduced.add(part);
  e.cost = static_cast<double>(seen_by_.size()) / kTogether * e.reduced.cost.mean() + cost_of_ties();
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

/// False where there is no solution; all stays then.
bool Bundle::move(const Equations& e, double damping) {
  const std::size_t views = views_.size();
  const Part& reduced = e.reduced;
  Blocks blocks;
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const auto [k, j] = pairs_[p];
    blocks.add(k, j, reduced.blocks[p]);
    if (j != k) continue;
    Matrix6d damp = Matrix6d::Zero();
    damp.diagonal() = damping * reduced.blocks[p].diagonal().cwiseAbs() + Vector6d::Constant(k == 0 ? kHeld : 1e-3);
    blocks.add(k, k, damp);
  }
  std::vector<Vector6d> right_side = reduced.right;
  add_ties(ties_, poses_, blocks, right_side);
  const Shutter now(shutter_.clock, shutter_.readout);
  const Shutter prior(1 / (kClockPrior * kClockPrior), finds_readout_ ? 1 / (kReadoutPrior * kReadoutPrior) : kHeld);
  Eigen::Matrix2d corner = reduced.corner;
  corner.diagonal() += prior;
  const Shutter corner_right = reduced.corner_right - prior.cwiseProduct(now);

  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver(blocks.matrix(views));
  if (solver.info() != Eigen::Success) return false;
  Eigen::MatrixXd right(static_cast<int>(6 * views), 3);
  for (std::size_t k = 0; k < views; ++k) {
    right.block<6, 1>(static_cast<int>(6 * k), 0) = right_side[k];
    right.block<6, 2>(static_cast<int>(6 * k), 1) = reduced.border[k];
  }
  const Eigen::MatrixXd solved = solver.solve(right);
  const Eigen::Matrix2d shutter_information = corner - right.rightCols(2).transpose() * solved.rightCols(2);
  const Shutter shutter_step =
      shutter_information.ldlt().solve(Shutter(corner_right - right.rightCols(2).transpose() * solved.col(0)));
  const Eigen::VectorXd pose_steps = solved.col(0) - solved.rightCols(2) * shutter_step;
  for (std::size_t k = 0; k < views; ++k)
    poses_[k] = poses_[k] * retract(pose_steps.segment<6>(static_cast<int>(6 * k)));
  shutter_.clock += shutter_step[0], shutter_.readout += shutter_step[1];
  move_surfels(e, pose_steps, shutter_step);
  readout_sigma_ = std::sqrt(shutter_information.inverse()(1, 1));
  return true;
}

/// Levenberg-Marquardt: a step that does not help is taken back, and the next one is shorter.
void Bundle::descend() {
  double damping = 1e-6;
  Equations now = linearise();
  for (int i = 0; i < kSteps; ++i) {
    const auto poses = poses_;
    const auto surfels = surfels_;
    const BundleShutter shutter = shutter_;
    const double readout_sigma = readout_sigma_;
    if (!move(now, damping)) {
      damping = std::max(1e-4, 10 * damping);
      continue;
    }
    if (Equations next = linearise(); next.cost < now.cost) {
      now = std::move(next);
      damping = std::max(1e-7, 0.2 * damping);
      continue;
    }
    poses_ = poses, surfels_ = surfels, shutter_ = shutter, readout_sigma_ = readout_sigma;
    damping = std::max(1e-5, 10 * damping);
  }
}

}  // namespace cairn
