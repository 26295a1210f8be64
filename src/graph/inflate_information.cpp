// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "graph/inflate_information.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace cairn {
namespace {

// Rad, m: errors independent of the number of points.
constexpr double kRotationFloor = 0.003, kTranslationFloor = 0.004;
constexpr double kCorrelatedPoints = 100;  // neighboring points that count as one
constexpr double kMinInformation = 1e-6;

/// Single-precision sums: unconstrained directions may have slightly negative eigenvalues.
Matrix6d without_negative(const Matrix6d& information) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(information);
  return solver.eigenvectors() * solver.eigenvalues().cwiseMax(kMinInformation).asDiagonal() *
         solver.eigenvectors().transpose();
}

}  // namespace

Matrix6d inflate_information(const Matrix6d& information) {
  Matrix6d definite = information + kMinInformation * Matrix6d::Identity();
  if (Eigen::LLT<Matrix6d>(definite).info() != Eigen::Success) definite = without_negative(information);
  Matrix6d covariance = kCorrelatedPoints * definite.inverse();
  covariance.diagonal().head<3>().array() += kRotationFloor * kRotationFloor;
  covariance.diagonal().tail<3>().array() += kTranslationFloor * kTranslationFloor;
  return covariance.inverse();
}

}  // namespace cairn
