// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Normal equations of a bundle adjustment, shared by the files that build and solve them.
#pragma once
#include <Eigen/Cholesky>
#include <Eigen/CholmodSupport>
#include <array>
#include <utility>
#include <vector>

#include "bundle/bundle.hpp"

namespace cairn {

constexpr std::uint32_t kNoPair = ~0u;

/// Index into Bundle::pair_of_ of a pair of views; `j` is the earlier one.
[[nodiscard]] constexpr std::size_t number_of(std::size_t k, std::size_t j) { return k * (k + 1) / 2 + j; }

/// Reduced system after elimination of surfels. Symmetric matrices use the lower triangle.
struct Bundle::Part {
  std::vector<Matrix6d> blocks;                                  // by pair of views
  std::vector<Vector6d> right;                                   // by view
  std::vector<Eigen::Matrix<double, 6, Eigen::Dynamic>> border;  // by view: coupling with the shared unknowns
  Eigen::MatrixXd corner;                                        // of the shared unknowns
  Eigen::VectorXd corner_right;
  std::vector<double> node_information;  // of each node of the correction, given all other unknowns
  Cost cost;

  Part(std::size_t pairs, std::size_t views, int unknowns, std::size_t nodes)
      : blocks(pairs, Matrix6d::Zero()),
        right(views, Vector6d::Zero()),
        border(views, Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, unknowns)),
        corner(Eigen::MatrixXd::Zero(unknowns, unknowns)),
        corner_right(Eigen::VectorXd::Zero(unknowns)),
        node_information(nodes, 0.0) {}
  void add(const Part& other) {
    for (std::size_t i = 0; i < blocks.size(); ++i) blocks[i] += other.blocks[i];
    for (std::size_t i = 0; i < right.size(); ++i) right[i] += other.right[i], border[i] += other.border[i];
    corner += other.corner, corner_right += other.corner_right;
    for (std::size_t i = 0; i < node_information.size(); ++i) node_information[i] += other.node_information[i];
    cost.add(other.cost);
  }
  /// Adds the contribution of surfels seen only by these views from another part, and clears it there.
  void take(Part& other, const std::vector<std::uint32_t>& views, const std::vector<std::uint32_t>& pairs) {
    for (const std::uint32_t i : pairs) blocks[i] += other.blocks[i], other.blocks[i].setZero();
    for (const std::uint32_t k : views) {
      right[k] += other.right[k], border[k] += other.border[k];
      other.right[k].setZero(), other.border[k].setZero();
    }
    corner += other.corner, corner_right += other.corner_right;
    other.corner.setZero(), other.corner_right.setZero();
    for (std::size_t i = 0; i < node_information.size(); ++i)
      node_information[i] += std::exchange(other.node_information[i], 0.0);
    cost.add(std::exchange(other.cost, {}));
  }
};

struct Bundle::Equations {
  using WithView = Eigen::Matrix<double, 3, 6>;
  using WithShared = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, kUnknowns>;
  // By surfel: its own block, inverted, and its coupling with the shared unknowns; by observation: with its view.
  std::vector<Eigen::Matrix3d> inverse;
  std::vector<Eigen::Vector3d> gradient;
  std::vector<WithShared> with_shared;
  std::vector<WithView> with_view;
  std::vector<WithNodes> with_nodes;  // empty without a correction
  Part reduced = {0, 0, 0, 0};
  double cost = 0;
};

/// Solver of the reduced system: poses and shared unknowns.
struct Bundle::Solver {
  Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>, Eigen::Lower> poses;
  Eigen::VectorXd right;           // of poses
  Eigen::MatrixXd border, solved;  // coupling of poses with shared unknowns, and its solution by the poses' block
  Eigen::LLT<Eigen::MatrixXd> shared;
  bool has_solution = false;

  Solver(const Bundle& bundle, const Equations& equations, double damping);
};

}  // namespace cairn
