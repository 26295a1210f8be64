// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <Eigen/SVD>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <vector>

#include "cairn/mapping/pose_graph.hpp"
#include "graph/components.hpp"

namespace cairn {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

/// Weights of rotation and translation in the chordal cost (Rosen et al. 2019, as their reference implementation reads
/// a graph).
struct Weights {
  explicit Weights(const Matrix6d& information)
      : kappa(1.5 / information.topLeftCorner<3, 3>().inverse().trace()),
        tau(3.0 / information.bottomRightCorner<3, 3>().inverse().trace()) {}
  double kappa, tau;
};

/// Linear least squares in `unknowns` values for three right-hand sides at a time; each component's anchor is fixed.
class Problem {
 public:
  explicit Problem(Eigen::Index unknowns) : rhs_(Eigen::MatrixXd::Zero(unknowns, 3)) {}
  void add(Eigen::Index row, Eigen::Index column, double value) { triplets_.emplace_back(row, column, value); }
  auto rhs(Eigen::Index row) { return rhs_.row(row); }
  [[nodiscard]] Eigen::MatrixXd solve() const {
    Sparse a(rhs_.rows(), rhs_.rows());
    a.setFromTriplets(triplets_.begin(), triplets_.end());
    Eigen::SimplicialLDLT<Sparse> solver(a);
    return solver.solve(rhs_);
  }

 private:
  std::vector<Eigen::Triplet<double>> triplets_;
  Eigen::MatrixXd rhs_;
};

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
  return u * svd.matrixV().transpose();
}

/// Relaxed rotations as general matrices, from the given rotations of the anchors; three columns per node.
Eigen::MatrixXd relaxed_rotations(const PoseGraph& graph, const std::vector<double>& weights,
                                  const std::vector<Eigen::Index>& number, Eigen::Index count,
                                  const std::vector<Eigen::Isometry3d>& poses) {
  // The three rows of all rotations solve the same equations: row(R_j) = row(R_i) R_ij.
  Problem rotations(3 * count);
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    if (weights[e] <= 0) continue;
    const auto& edge = graph.edges[e];
    const double kappa = weights[e] * Weights(edge.information).kappa;
    const Eigen::Index i = number[edge.i], j = number[edge.j];
    const Eigen::Matrix3d measured = edge.i_from_j.linear();
    for (int k = 0; k < 3; ++k) {
      if (i >= 0) rotations.add(3 * i + k, 3 * i + k, kappa);
      if (j >= 0) rotations.add(3 * j + k, 3 * j + k, kappa);
      for (int l = 0; l < 3; ++l) {
        if (i >= 0 && j >= 0) {
          rotations.add(3 * i + k, 3 * j + l, -kappa * measured(k, l));
          rotations.add(3 * j + l, 3 * i + k, -kappa * measured(k, l));
        } else if (i >= 0) {
          rotations.rhs(3 * i + k) += kappa * measured(k, l) * poses[edge.j].linear().col(l).transpose();
        } else if (j >= 0) {
          rotations.rhs(3 * j + l) += kappa * measured(k, l) * poses[edge.i].linear().col(k).transpose();
        }
      }
    }
  }
  return rotations.solve();
}

/// Optimal translations for the rotations of `poses`; one row per node.
Eigen::MatrixXd fitting_translations(const PoseGraph& graph, const std::vector<double>& weights,
                                     const std::vector<Eigen::Index>& number, Eigen::Index count,
                                     const std::vector<Eigen::Isometry3d>& poses) {
  Problem translations(count);
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    if (weights[e] <= 0) continue;
    const auto& edge = graph.edges[e];
    const double tau = weights[e] * Weights(edge.information).tau;
    const Eigen::Index i = number[edge.i], j = number[edge.j];
    const Eigen::RowVector3d step = (poses[edge.i].linear() * edge.i_from_j.translation()).transpose();  // t_j - t_i
    if (i >= 0) {
      translations.add(i, i, tau);
      translations.rhs(i) -= tau * step;
      if (j >= 0)
        translations.add(i, j, -tau);
      else
        translations.rhs(i) += tau * poses[edge.j].translation().transpose();
    }
    if (j >= 0) {
      translations.add(j, j, tau);
      translations.rhs(j) += tau * step;
      if (i >= 0)
        translations.add(j, i, -tau);
      else
        translations.rhs(j) += tau * poses[edge.i].translation().transpose();
    }
  }
  return translations.solve();
}

}  // namespace

std::vector<Eigen::Isometry3d> chordal_initialization(const PoseGraph& graph, const std::vector<double>& weights) {
  std::vector<Eigen::Isometry3d> poses = graph.world_from_node;
  const std::vector<std::size_t> anchors = component_of(graph, weights);
  // Unknowns are numbered over the nodes other than anchors.
  std::vector<Eigen::Index> number(poses.size(), -1);
  Eigen::Index count = 0;
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (anchors[i] != i) number[i] = count++;
  if (count == 0) return poses;

  const Eigen::MatrixXd columns = relaxed_rotations(graph, weights, number, count, poses);
  for (std::size_t n = 0; n < poses.size(); ++n) {
    if (number[n] < 0) continue;
    const Eigen::Matrix3d m = columns.middleRows<3>(3 * number[n]).transpose();
    if (m.allFinite()) poses[n].linear() = nearest_rotation(m);
  }
  const Eigen::MatrixXd rows = fitting_translations(graph, weights, number, count, poses);
  for (std::size_t n = 0; n < poses.size(); ++n)
    if (number[n] >= 0 && rows.row(number[n]).allFinite()) poses[n].translation() = rows.row(number[n]).transpose();
  return poses;
}

double chordal_cost(const PoseGraph& graph) {
  double cost = 0;
  for (const auto& edge : graph.edges) {
    const Weights w(edge.information);
    const Eigen::Isometry3d &i = graph.world_from_node[edge.i], &j = graph.world_from_node[edge.j];
    cost += w.kappa * (j.linear() - i.linear() * edge.i_from_j.linear()).squaredNorm() +
            w.tau * (j.translation() - i * edge.i_from_j.translation()).squaredNorm();
  }
  return cost;
}

}  // namespace cairn
