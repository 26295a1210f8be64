// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gauss-Newton steps: surfels are eliminated, and the reduced system is solved by sparse Cholesky.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "bundle/bundle_equations.hpp"
#include "geometry/node_interpolation.hpp"
#include "geometry/student_t.hpp"

namespace cairn {
namespace {

constexpr double kObservationWeight = 1 / Bundle::kCorrelatedObservations;  // weight of an observation
constexpr int kMaxSteps = 3, kMaxAttempts = 6;                              // per round
constexpr double kDampingGrowth = 20;                                       // of the damping after a failed step
constexpr double kMaxCostRatio = 1.01;      // times the cost, for the last step: further attempts are not worthwhile
constexpr std::size_t kParts = 16;          // partial sums over surfels, added in a fixed order on every machine
constexpr std::size_t kLargeParts = 4;      // the same with a depth correction, which takes much memory
constexpr double kFixedInformation = 1e12;  // information that fixes an unknown
constexpr double kMaxSurfelStep = 0.05;     // m, of a surfel
// Keeps unconstrained surfels in place.
const Eigen::Vector3d kSurfelPrior = Eigen::Vector3d(1e-2, 1e-6, 1e-6) / Bundle::kCorrelatedObservations;

/// Correction nodes around a pixel, with interpolation weights.
struct Nodes {
  std::array<int, 4> node;
  std::array<double, 4> share;
  Nodes(const DepthCorrection& grid, const Eigen::Vector2f& place) {
    const NodeInterpolation across(place.x(), grid.columns), down(place.y(), grid.rows);
    const int first = down.first * grid.columns + across.first;
    const double u = static_cast<double>(across.share), v = static_cast<double>(down.share);
    node = {first, first + 1, first + grid.columns, first + grid.columns + 1};
    share = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
  }
};

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

void add_edges(const std::vector<PoseGraph::Edge>& edges, const std::vector<Eigen::Isometry3d>& poses, Blocks& blocks,
               std::vector<Vector6d>& right) {
  for (const auto& edge : edges) {
    const Eigen::Isometry3d j_from_i = poses[edge.j].inverse() * poses[edge.i];
    const Vector6d off = local_coordinates(edge.i_from_j.inverse() * j_from_i.inverse());
    const Matrix6d information = weight_of_step(off.dot(edge.information * off)) * edge.information;
    const Matrix6d by_i = -adjoint(j_from_i), left = by_i.transpose() * information;
    blocks.add(edge.i, edge.i, left * by_i);
    blocks.add(edge.j, edge.j, information);
    if (edge.i > edge.j)
      blocks.add(edge.i, edge.j, left);
    else
      blocks.add(edge.j, edge.i, left.transpose());
    right[edge.i] -= left * off;
    right[edge.j] -= information * off;
  }
}

}  // namespace

void Bundle::find_pairs() {
  const std::size_t views = views_.size();
  pair_of_.assign(number_of(views, 0), kNoPair);
  for (std::size_t k = 0; k < views; ++k) pair_of_[number_of(k, k)] = 0;
  for (std::size_t s = 0; s < surfels_.size(); ++s)
    for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o)
      for (std::uint32_t other = first_[s]; other < o; ++other) pair_of_[number_of(seen_by_[o], seen_by_[other])] = 0;
  pairs_.clear();
  for (std::size_t k = 0; k < views; ++k)
    for (std::size_t j = 0; j <= k; ++j) {
      if (pair_of_[number_of(k, j)] == kNoPair) continue;
      pair_of_[number_of(k, j)] = static_cast<std::uint32_t>(pairs_.size());
      pairs_.emplace_back(static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(j));
    }
}

void Bundle::linearize(std::size_t s, Equations& e, Part& part) const {
  const int shared = shared_unknowns();
  Eigen::Matrix3d own = kSurfelPrior.asDiagonal();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  Equations::WithShared with_shared = Equations::WithShared::Zero(3, shared);
  Seen seen;
  for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o) {
    const std::size_t k = seen_by_[o];
    Equations::WithView with_view = Equations::WithView::Zero();
    if (observe(surfels_[s], k, true, seen)) {
      part.cost.add(*this, seen);
      Matrix6d& block = part.blocks[pair_of_[number_of(k, k)]];
      for (int i = 0; i < seen.count; ++i) {
        const Residual& r = seen.residual[static_cast<std::size_t>(i)];
        const auto by_shared = r.by_shared.head(shared);
        const double weight = kObservationWeight * r.weight;
        const Vector6d by_pose = weight * r.by_pose;
        const Eigen::Vector3d by_surfel = weight * r.by_surfel;
        block.noalias() += by_pose * r.by_pose.transpose();
        part.right[k] -= r.value * by_pose;
        part.border[k].leftCols(shared).noalias() += by_pose * by_shared.transpose();
        part.corner.topLeftCorner(shared, shared).noalias() += weight * by_shared * by_shared.transpose();
        part.corner_right.head(shared) -= weight * r.value * by_shared;
        own.noalias() += by_surfel * r.by_surfel.transpose();
        gradient += r.value * by_surfel;
        with_view.noalias() += by_surfel * r.by_pose.transpose();
        with_shared.noalias() += by_surfel * by_shared.transpose();
      }
      if (!e.with_nodes.empty()) e.with_nodes[o] = add_nodes(seen, k, part);
    }
    e.with_view[o] = with_view;
  }
  e.inverse[s] = own.inverse(), e.gradient[s] = gradient, e.with_shared[s] = with_shared;
  eliminate(s, e, part);
  if (!e.with_nodes.empty()) eliminate_with_nodes(s, e, part);
}

/// Adds the terms of a view's gap with the correction's nodes.
Bundle::WithNodes Bundle::add_nodes(const Seen& seen, std::size_t k, Part& part) const {
  const int shared = shared_unknowns();
  const Residual& gap = seen.residual[0];
  const auto by_shared = gap.by_shared.head(shared);
  const Nodes nodes(shared_.correction, places_[seen.pixel]);
  const double weight = kObservationWeight * gap.weight;
  for (std::size_t i = 0; i < 4; ++i) {
    const int row = shared + nodes.node[i];
    const double by_node = seen.by_offset * nodes.share[i], weighted = weight * by_node;
    part.border[k].col(row) += weighted * gap.by_pose;
    part.corner.row(row).head(shared) += weighted * by_shared.transpose();
    for (std::size_t j = 0; j <= i; ++j)
      part.corner(row, shared + nodes.node[j]) += weighted * seen.by_offset * nodes.share[j];
    part.corner_right[row] -= weighted * gap.value;
    part.node_information[static_cast<std::size_t>(nodes.node[i])] += weighted * by_node;
  }
  return {.pixel = seen.pixel, .value = weight * gap.by_surfel[0] * seen.by_offset};
}

void Bundle::eliminate(std::size_t s, const Equations& e, Part& part) const {
  const int shared = shared_unknowns();
  const Equations::WithShared& with_shared = e.with_shared[s];
  for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o) {
    const std::size_t k = seen_by_[o];
    const Eigen::Matrix<double, 6, 3> eliminated = e.with_view[o].transpose() * e.inverse[s];
    part.right[k].noalias() += eliminated * e.gradient[s];
    part.border[k].leftCols(shared).noalias() -= eliminated * with_shared;
    for (std::uint32_t other = first_[s]; other <= o; ++other)
      part.blocks[pair_of_[number_of(k, seen_by_[other])]].noalias() -= eliminated * e.with_view[other];
  }
  const Equations::WithShared eliminated = e.inverse[s] * with_shared;
  part.corner.topLeftCorner(shared, shared).noalias() -= eliminated.transpose() * with_shared;
  part.corner_right.head(shared).noalias() += eliminated.transpose() * e.gradient[s];
}

void Bundle::eliminate_with_nodes(std::size_t s, const Equations& e, Part& part) const {
  struct Entry {
    int row;
    double with_surfel;
  };
  std::vector<Entry> entries;
  const int shared = shared_unknowns();
  for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o) {
    const Nodes nodes(shared_.correction, places_[e.with_nodes[o].pixel]);
    for (std::size_t i = 0; i < 4; ++i)
      entries.push_back({shared + nodes.node[i], e.with_nodes[o].value * nodes.share[i]});
  }
  const Eigen::Vector3d place = e.inverse[s].col(0);
  const Eigen::RowVectorXd with_shared = place.transpose() * e.with_shared[s];
  const double gradient = place.dot(e.gradient[s]);
  for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o) {
    const Vector6d eliminated = e.with_view[o].transpose() * place;
    auto& border = part.border[seen_by_[o]];
    for (const Entry& i : entries) border.col(i.row) -= i.with_surfel * eliminated;
  }
  for (const Entry& i : entries) {
    part.corner.row(i.row).head(shared) -= i.with_surfel * with_shared;
    part.corner_right[i.row] += i.with_surfel * gradient;
    for (const Entry& j : entries)
      if (j.row <= i.row) part.corner(i.row, j.row) -= i.with_surfel * j.with_surfel * place[0];
  }
}

Bundle::Equations Bundle::no_equations() const {
  const std::size_t surfels = surfels_.size(), nodes = shared_.correction.offsets.size();
  return {.inverse = std::vector<Eigen::Matrix3d>(surfels),
          .gradient = std::vector<Eigen::Vector3d>(surfels),
          .with_shared = std::vector<Equations::WithShared>(surfels),
          .with_view = std::vector<Equations::WithView>(seen_by_.size()),
          .with_nodes = std::vector<WithNodes>(nodes > 0 ? seen_by_.size() : 0),
          .reduced = {pairs_.size(), views_.size(), shared_unknowns() + static_cast<int>(nodes), nodes}};
}

Bundle::Equations Bundle::linearize() const {
  const std::size_t surfels = surfels_.size(), nodes = shared_.correction.offsets.size();
  Equations e = no_equations();
  std::vector<Part> parts(nodes > 0 ? kLargeParts : kParts, e.reduced);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t p) {
    for (std::size_t s = p * surfels / parts.size(); s < (p + 1) * surfels / parts.size(); ++s)
      linearize(s, e, parts[p]);
  });
  for (const Part& part : parts) e.reduced.add(part);
  e.cost = cost_of(e.reduced.cost);
  add_priors(e);
  return e;
}

/// Cost as in linearize(), without the equations. The same nodes of the correction count as seen as in `before`.
double Bundle::cost(const Equations& before) const {
  const std::size_t surfels = surfels_.size();
  std::vector<Cost> parts(shared_.correction.offsets.empty() ? kParts : kLargeParts);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t p) {
    Seen seen;
    for (std::size_t s = p * surfels / parts.size(); s < (p + 1) * surfels / parts.size(); ++s)
      for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o)
        if (observe(surfels_[s], seen_by_[o], true, seen)) parts[p].add(*this, seen);
  });
  Cost sum;
  for (const Cost& part : parts) sum.add(part);
  const int unknowns = static_cast<int>(before.reduced.corner.cols());
  Equations priors{.reduced = {0, 0, unknowns, 0}, .cost = cost_of(sum)};
  priors.reduced.node_information = before.reduced.node_information;
  add_priors(priors);
  return priors.cost;
}

void Bundle::move_surfels(const Equations& e, const Eigen::VectorXd& pose_steps, const Eigen::VectorXd& shared_step) {
  const int shared = shared_unknowns();
  tbb::parallel_for(std::size_t{0}, surfels_.size(), [&](std::size_t s) {
    Eigen::Vector3d g = e.gradient[s] + e.with_shared[s] * shared_step.head(shared);
    for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o) {
      g += e.with_view[o] * pose_steps.segment<6>(static_cast<int>(6 * seen_by_[o]));
      if (e.with_nodes.empty()) continue;
      const Nodes nodes(shared_.correction, places_[e.with_nodes[o].pixel]);
      for (std::size_t i = 0; i < 4; ++i)
        g[0] += e.with_nodes[o].value * nodes.share[i] * shared_step[shared + nodes.node[i]];
    }
    const Eigen::Vector3d move = -e.inverse[s] * g;
    surfels_[s].position += std::clamp(move[0], -kMaxSurfelStep, kMaxSurfelStep) * surfels_[s].normal;
    surfels_[s].lateral_brightness += move.tail<2>();
  });
}

Bundle::Solver::Solver(const Bundle& bundle, const Equations& e, double damping) {
  const std::size_t views = bundle.views_.size();
  const Part& reduced = e.reduced;
  Blocks blocks;
  for (std::size_t p = 0; p < bundle.pairs_.size(); ++p) {
    const auto [k, j] = bundle.pairs_[p];
    blocks.add(k, j, reduced.blocks[p]);
    if (j != k) continue;
    Matrix6d damp = Matrix6d::Zero();
    damp.diagonal() =
        damping * reduced.blocks[p].diagonal().cwiseAbs() + Vector6d::Constant(k == 0 ? kFixedInformation : 1e-3);
    blocks.add(k, k, damp);
  }
  std::vector<Vector6d> right_side = reduced.right;
  add_edges(bundle.edges_, bundle.poses_, blocks, right_side);
  poses.cholmod().print = 0;  // failure is reported by `has_solution`
  poses.compute(blocks.matrix(views));
  if (poses.info() != Eigen::Success) return;
  border.resize(static_cast<int>(6 * views), reduced.corner.cols());
  right.resize(border.rows());
  for (std::size_t k = 0; k < views; ++k) {
    right.segment<6>(static_cast<int>(6 * k)) = right_side[k];
    border.middleRows<6>(static_cast<int>(6 * k)) = reduced.border[k];
  }
  solved = poses.solve(border);
  Eigen::MatrixXd information = reduced.corner.selfadjointView<Eigen::Lower>();
  information.diagonal() *= 1 + damping;
  information.noalias() -= border.transpose() * solved;
  shared.compute(information);
  has_solution = shared.info() == Eigen::Success;
}

/// Returns false without a solution; the state is unchanged then.
bool Bundle::move(const Equations& e, double damping) {
  const Solver solver(*this, e, damping);
  if (!solver.has_solution) return false;
  Eigen::MatrixXd solution(solver.border.cols(), 2);  // the step, and a column of the covariance
  solution.col(0) = e.reduced.corner_right - solver.solved.transpose() * solver.right;
  solution.col(1) = Eigen::VectorXd::Unit(solver.border.cols(), kReadout);
  solver.shared.solveInPlace(solution);
  const Eigen::VectorXd shared_step = solution.col(0);
  const Eigen::VectorXd pose_steps = solver.poses.solve(solver.right) - solver.solved * shared_step;
  for (std::size_t k = 0; k < views_.size(); ++k)
    poses_[k] = poses_[k] * retract(pose_steps.segment<6>(static_cast<int>(6 * k)));
  move_surfels(e, pose_steps, shared_step);
  move_shared(shared_step);
  readout_sigma_ = std::sqrt(solution(kReadout, 1));
  return true;
}

/// Levenberg-Marquardt: a failed step is undone and repeated with more damping. After the last step the cost suffices.
void Bundle::descend() {
  double damping = 1e-6;
  Equations now = linearize();
  for (int i = 0, attempts = 0; i < kMaxSteps && attempts < kMaxAttempts; ++attempts) {
    const auto poses = poses_;
    const auto surfels = surfels_;
    const Shared shared = shared_;
    const double readout_sigma = readout_sigma_;
    if (!move(now, damping)) {
      damping = std::max(1e-4, kDampingGrowth * damping);
      continue;
    }
    const bool is_last = i + 1 == kMaxSteps;
    Equations next = is_last ? Equations{.cost = cost(now)} : linearize();
    if (next.cost < now.cost) {
      now = std::move(next);
      damping = std::max(1e-7, 0.2 * damping);
      ++i;
      continue;
    }
    poses_ = poses, surfels_ = surfels, shared_ = shared, readout_sigma_ = readout_sigma;
    refresh();
    if (is_last && next.cost < kMaxCostRatio * now.cost) return;
    damping = std::max(1e-5, kDampingGrowth * damping);
  }
}

}  // namespace cairn
