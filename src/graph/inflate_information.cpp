// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "graph/inflate_information.hpp"

namespace cairn {
namespace {

// Rad, m: errors independent of the number of points.
constexpr double kRotationFloor = 0.003, kTranslationFloor = 0.004;
constexpr double kCorrelatedPoints = 100;  // neighboring points that count as one

}  // namespace

Matrix6d inflate_information(const Matrix6d& information) {
  Matrix6d covariance = kCorrelatedPoints * (information + 1e-6 * Matrix6d::Identity()).inverse();
  covariance.diagonal().head<3>().array() += kRotationFloor * kRotationFloor;
  covariance.diagonal().tail<3>().array() += kTranslationFloor * kTranslationFloor;
  return covariance.inverse();
}

}  // namespace cairn
