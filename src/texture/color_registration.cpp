// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "texture/color_registration.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace cairn {
namespace {

constexpr std::size_t kMinResiduals = 2000;  // minimum number of residuals, pairs of a point and a keyframe
constexpr double kHuber = 0.06;              // relative to the brightness range
constexpr double kMaxCostRatio = 0.9;        // maximum ratio of the new to the old cost

using Vector = Eigen::Matrix<double, 7, 1>;  // rotation vector, translation in meters, focal scale - 1
using Matrix = Eigen::Matrix<double, 7, 7>;

shader::ColorCamera camera_of(const Vector& x) {
  return {Eigen::Vector3f(x.head<3>().cast<float>()), Eigen::Vector3f(x.segment<3>(3).cast<float>()),
          static_cast<float>(1 + x[6])};
}

double robust(double r) {  // Huber 1964
  return std::abs(r) <= kHuber ? r * r : kHuber * (2 * std::abs(r) - kHuber);
}

/// Differences from the mean brightness of a point, for points with at least two observations.
struct Residuals {
  std::vector<double> value;
  double cost = 0;  // mean robust cost
};

/// `which`: observations to use; nullptr: all.
Residuals residuals_of(const ColorObservations& o, const std::vector<float>& brightness,
                       const std::vector<bool>* which) {
  std::vector<double> sum(o.points, 0), count(o.points, 0);
  const auto counts = [&](std::size_t i) { return brightness[i] >= 0 && (which == nullptr || (*which)[i]); };
  for (std::size_t i = 0; i < brightness.size(); ++i)
    if (counts(i)) sum[o.point[i]] += static_cast<double>(brightness[i]), ++count[o.point[i]];
  Residuals r;
  for (std::size_t i = 0; i < brightness.size(); ++i) {
    const std::size_t p = o.point[i];
    if (!counts(i) || count[p] < 2) continue;
    r.value.push_back(static_cast<double>(brightness[i]) - sum[p] / count[p]);
    r.cost += robust(r.value.back());
  }
  if (!r.value.empty()) r.cost /= static_cast<double>(r.value.size());
  return r;
}

Residuals residuals_at(const ColorObservations& o, const Vector& x, bool sharp,
                       const std::vector<bool>* which = nullptr) {
  return residuals_of(o, o.brightness(camera_of(x), sharp), which);
}

/// Initial value: the field of view usually has the largest error.
Vector best_focal_scale(const ColorObservations& o) {
  Vector best = Vector::Zero();
  double min_cost = std::numeric_limits<double>::infinity();
  for (const double focal_scale : {0.0, -0.04, 0.04, -0.08, 0.08, -0.12, 0.12}) {
    Vector x = Vector::Zero();
    x[6] = focal_scale;
    const double cost = residuals_at(o, x, false).cost;
    if (cost < (focal_scale == 0 ? 1.0 : 0.97) * min_cost) min_cost = cost, best = x;
  }
  return best;
}

/// Normal equations at a camera, from the observations visible with this camera and all finite-difference steps.
struct NormalEquations {
  Matrix a = Matrix::Zero();
  Vector g = Vector::Zero();
  double cost = 0;
  std::vector<bool> seen_by_all;  // by observation
};

NormalEquations linearize(const ColorObservations& o, const Vector& x, bool sharp) {
  // Finite-difference steps and standard deviations of the prior: radians, meters, focal scale.
  const Vector step = (Vector() << 2e-3, 2e-3, 2e-3, 4e-3, 4e-3, 4e-3, 2e-3).finished();
  const Vector prior_sigma = (Vector() << 0.02, 0.02, 0.02, 0.03, 0.03, 0.03, 0.05).finished();
  const std::vector<float> at = o.brightness(camera_of(x), sharp);
  NormalEquations n;
  n.seen_by_all.assign(at.size(), true);
  std::array<std::vector<float>, 7> stepped;
  for (std::size_t p = 0; p < stepped.size(); ++p) {
    Vector moved = x;
    moved[static_cast<int>(p)] += step[static_cast<int>(p)];
    stepped[p] = o.brightness(camera_of(moved), sharp);
    for (std::size_t i = 0; i < at.size(); ++i) n.seen_by_all[i] = n.seen_by_all[i] && at[i] >= 0 && stepped[p][i] >= 0;
  }
  const Residuals now = residuals_of(o, at, &n.seen_by_all);
  n.cost = now.cost;
  std::array<Residuals, 7> moved;
  for (std::size_t p = 0; p < stepped.size(); ++p) moved[p] = residuals_of(o, stepped[p], &n.seen_by_all);
  for (std::size_t r = 0; r < now.value.size(); ++r) {
    Vector j;
    for (std::size_t p = 0; p < moved.size(); ++p)
      j[static_cast<int>(p)] = (moved[p].value[r] - now.value[r]) / step[static_cast<int>(p)];
    const double w = std::min(1.0, kHuber / std::max(std::abs(now.value[r]), 1e-9));
    n.a += w * j * j.transpose();
    n.g += w * now.value[r] * j;
  }
  // Prior centered at the nominal camera; assumes noise of 0.1.
  const Vector prior = (0.01 * prior_sigma.array().square().inverse()).matrix();
  n.a.diagonal() += prior;
  n.g += prior.cwiseProduct(x);
  return n;
}

/// Levenberg-Marquardt. Own implementation, because the set of valid observations changes with every step.
Vector refine(const ColorObservations& o, Vector x, bool sharp, int iterations) {
  double damping = 1e-3;
  for (int i = 0; i < iterations; ++i) {
    NormalEquations n = linearize(o, x, sharp);
    n.a.diagonal() *= 1 + damping;
    const Vector next = x - n.a.ldlt().solve(n.g);
    const double cost = residuals_at(o, next, sharp, &n.seen_by_all).cost;
    if (cost < n.cost) {
      x = next;
      damping *= 0.3;
      if (cost > 0.999 * n.cost) break;
    } else {
      damping *= 30;
      if (damping > 1e3) break;
    }
  }
  return x;
}

}  // namespace

std::optional<shader::ColorCamera> register_color_camera(const ColorObservations& observations) {
  const Residuals nominal = residuals_at(observations, Vector::Zero(), true);
  if (nominal.value.size() < kMinResiduals) return std::nullopt;
  Vector x = best_focal_scale(observations);
  x = refine(observations, x, false, 8);
  x = refine(observations, x, true, 6);
  if (!(residuals_at(observations, x, true).cost < kMaxCostRatio * nominal.cost)) return std::nullopt;
  return camera_of(x);
}

}  // namespace cairn
