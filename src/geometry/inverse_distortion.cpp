// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "geometry/inverse_distortion.hpp"

#include <Eigen/QR>

namespace cairn {

std::array<double, 8> invert_distortion(const Camera& camera, const std::array<double, 5>& inverse) {
  constexpr int kSteps = 24;
  const auto [k1, k2, p1, p2, k3] = inverse;
  Eigen::MatrixXd a(2 * (kSteps + 1) * (kSteps + 1), 5);
  Eigen::VectorXd b(a.rows());
  Eigen::Index row = 0;
  for (int i = 0; i <= kSteps; ++i)
    for (int j = 0; j <= kSteps; ++j, row += 2) {
      const double x = (camera.width * i / double{kSteps} - camera.cx) / camera.fx,
                   y = (camera.height * j / double{kSteps} - camera.cy) / camera.fy, m2 = x * x + y * y,
                   f = 1 + m2 * (k1 + m2 * (k2 + m2 * k3));
      const double u = x * f + 2 * p1 * x * y + p2 * (m2 + 2 * x * x),
                   v = y * f + 2 * p2 * x * y + p1 * (m2 + 2 * y * y);
      const double r2 = u * u + v * v;
      a.row(row) << u * r2, u * r2 * r2, 2 * u * v, r2 + 2 * u * u, u * r2 * r2 * r2;
      a.row(row + 1) << v * r2, v * r2 * r2, r2 + 2 * v * v, 2 * u * v, v * r2 * r2 * r2;
      b.segment<2>(row) << x - u, y - v;
    }
  const Eigen::VectorXd k = a.colPivHouseholderQr().solve(b);
  return {k[0], k[1], k[2], k[3], k[4]};
}

}  // namespace cairn
