// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gravity/gravity.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

namespace cairn {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr int kBins = 40;  // histogram bins along a side of the normals' cube: 2 degrees each
// Min. angle between candidates, and between the strongest directions.
constexpr double kMinCandidateAngle = 10 * kDegree;
constexpr std::size_t kMaxDirections = 10;  // directions to form candidates from
constexpr double kMinCrossSine = 0.5;       // min. sine of the angle between two directions to use their cross product
// Tukey windows of the iterations.
constexpr std::array kTukeyWindows{10 * kDegree, 7 * kDegree, 5 * kDegree, 4 * kDegree,
                                   4 * kDegree,  4 * kDegree, 4 * kDegree, 4 * kDegree};
constexpr double kMaxSupportAngle = 5 * kDegree;  // max. angle from horizontal or vertical to support a candidate
// Min. shares of horizontal, vertical surface for a direction.
constexpr double kMinHorizontalShare = 0.04, kMinVerticalShare = 0.05;
constexpr double kMinTwoWallsShare = 0.08;         // min. share of vertical surface alone
constexpr double kMinSupportShare = 0.3;           // min. share of surface in support of a candidate
constexpr double kMinConstraintShare = 0.1;        // min. share to refine a measured direction
constexpr double kMaxMeasuredError = 4 * kDegree;  // max. error of a measured direction
// Prior of camera poses.
constexpr double kMeanPitch = 20 * kDegree, kPitchSigma = 30 * kDegree, kRollSigma = 20 * kDegree;
constexpr double kMaxNegLogLikelihood = 8;    // max. -log likelihood of a single camera pose
constexpr double kSurfaceWeight = 2;          // weight of the surface term against the cameras' term
constexpr double kMinLogLikelihoodRatio = 1;  // min. log likelihood ratio to every other candidate
// Max. angle between the mean down direction of the images and the estimate.
constexpr double kMaxImageTilt = 60 * kDegree;

/// Surface whose normal is along a direction, with either sign.
struct Facing {
  Vector3d normal;
  double area;
};

struct Surfaces {
  std::vector<Facing> facings;
  double area = 0;  // total, including surface without a clear normal
};

/// Gathers the facings in bins on half a cube.
Surfaces gather_surfaces(std::span<const StructureView> views) {
  Surfaces surfaces;
  std::map<std::array<int, 3>, Vector3d> bins;
  for (const StructureView& view : views) {
    surfaces.area += static_cast<double>(view.structure->area);
    for (const Structure::Facing& f : view.structure->facings) {
      Vector3d n = view.world_from_camera * f.normal.cast<double>();
      int face = 0;
      n.cwiseAbs().maxCoeff(&face);
      if (n[face] < 0) n = -n;
      const auto cell = [&](int axis) { return static_cast<int>(std::floor((n[axis] / n[face] + 1) * kBins / 2)); };
      const auto [bin, is_new] = bins.try_emplace({face, cell((face + 1) % 3), cell((face + 2) % 3)}, Vector3d::Zero());
      bin->second += static_cast<double>(f.area) * n;
    }
  }
  for (const auto& [place, sum] : bins)
    if (const double area = sum.norm(); area > 0) surfaces.facings.push_back({sum / area, area});
  return surfaces;
}

/// Tukey's weight of an angle, from its sine.
double weight(double sine, double window) {
  const double u = sine / std::sin(window);
  return u < 1 ? (1 - u * u) * (1 - u * u) : 0;
}

/// Fits a direction to the horizontal and vertical surfaces near it.
Vector3d fit(const Surfaces& surfaces, Vector3d down) {
  for (const double window : kTukeyWindows) {
    Eigen::Matrix3d cost = Eigen::Matrix3d::Zero();  // down^T cost down is the sum of squared sines, up to a constant
    for (const auto& [n, area] : surfaces.facings) {
      const double along = n.dot(down), across = n.cross(down).norm();
      cost += area * (weight(std::abs(along), window) - weight(across, window)) * n * n.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(cost);
    const Vector3d best = solver.eigenvectors().col(0);
    down = best.dot(down) < 0 ? Vector3d(-best) : best;
  }
  return down;
}

GravityCandidate evaluate(const Surfaces& surfaces, const Vector3d& down) {
  GravityCandidate evaluated{.down = down};
  const Vector3d a = down.unitOrthogonal(), b = down.cross(a);
  Eigen::Matrix2d vertical_moments = Eigen::Matrix2d::Zero();
  for (const auto& [n, area] : surfaces.facings) {
    const double along = weight(std::abs(n.dot(down)), kMaxSupportAngle),
                 across = weight(n.cross(down).norm(), kMaxSupportAngle);
    evaluated.horizontal += across * area / surfaces.area;
    evaluated.vertical += along * area / surfaces.area;
    const Eigen::Vector2d side(n.dot(a), n.dot(b));
    vertical_moments += along * area / surfaces.area * side * side.transpose();
  }
  evaluated.min_constraint =
      evaluated.horizontal + vertical_moments.trace() / 2 -
      std::hypot((vertical_moments(0, 0) - vertical_moments(1, 1)) / 2, vertical_moments(0, 1));  // smaller eigenvalue
  return evaluated;
}

/// True if surfaces of at least two directions determine the direction.
bool is_constrained(const GravityCandidate& d) {
  const double two_walls = d.min_constraint - d.horizontal;
  return ((d.horizontal > kMinHorizontalShare && d.vertical > kMinVerticalShare) || two_walls > kMinTwoWallsShare) &&
         d.horizontal + d.vertical > kMinSupportShare;
}

std::vector<Vector3d> candidates(const Surfaces& surfaces) {
  std::vector<double> support(surfaces.facings.size(), 0);
  for (std::size_t i = 0; i < support.size(); ++i)
    for (const auto& [n, area] : surfaces.facings)
      support[i] += area * weight(n.cross(surfaces.facings[i].normal).norm(), kMaxSupportAngle);
  std::vector<std::size_t> order(support.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return support[a] > support[b]; });
  std::vector<Vector3d> directions;
  for (const std::size_t i : order) {
    const Vector3d& n = surfaces.facings[i].normal;
    const bool is_new = std::all_of(directions.begin(), directions.end(), [&](const Vector3d& s) {
      return s.cross(n).norm() > std::sin(kMinCandidateAngle);
    });
    if (is_new) directions.push_back(n);
    if (directions.size() == kMaxDirections) break;
  }
  std::vector<Vector3d> all = directions;
  for (std::size_t i = 0; i < directions.size(); ++i)
    for (std::size_t k = i + 1; k < directions.size(); ++k)
      if (const Vector3d cross = directions[i].cross(directions[k]); cross.norm() > kMinCrossSine)
        all.push_back(cross.normalized());
  return all;
}

/// Mean log likelihood of the camera poses for this down direction.
double log_likelihood(std::span<const StructureView> views, const Vector3d& down) {
  double sum = 0;
  for (const StructureView& view : views) {
    const Vector3d d = view.world_from_camera.transpose() * down;  // x right, y down, z forward
    const double pitch = (std::atan2(d.z(), d.y()) - kMeanPitch) / kPitchSigma,
                 roll = std::asin(std::clamp(d.x(), -1.0, 1.0)) / kRollSigma;
    sum -= std::min(kMaxNegLogLikelihood, 0.5 * (pitch * pitch + roll * roll));
  }
  return sum / static_cast<double>(views.size());
}

/// Angle in radians between the images' mean down direction and `down`.
double image_tilt(std::span<const StructureView> views, const Vector3d& down) {
  Vector3d sum = Vector3d::Zero();
  for (const StructureView& view : views) sum += view.world_from_camera.col(1);
  return std::acos(std::clamp(sum.normalized().dot(down), -1.0, 1.0));
}

}  // namespace

std::optional<GravityCandidate> vote_gravity(std::span<const StructureView> views) {
  const Surfaces surfaces = gather_surfaces(views);
  if (surfaces.facings.empty()) return std::nullopt;
  std::vector<std::pair<double, GravityCandidate>> accepted;
  for (const Vector3d& candidate : candidates(surfaces)) {
    GravityCandidate evaluated = evaluate(surfaces, fit(surfaces, candidate));
    if (!is_constrained(evaluated)) continue;
    const double surface_score = kSurfaceWeight * std::log(evaluated.horizontal + evaluated.vertical);
    const double same = log_likelihood(views, evaluated.down), opposite = log_likelihood(views, -evaluated.down);
    if (opposite > same) evaluated.down = -evaluated.down;
    accepted.emplace_back(surface_score + std::max(same, opposite), evaluated);
  }
  if (accepted.empty()) return std::nullopt;
  const auto best = *std::max_element(accepted.begin(), accepted.end(),
                                      [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [score, other] : accepted)
    if (other.down.cross(best.second.down).norm() > std::sin(kMinCandidateAngle) &&
        score > best.first - kMinLogLikelihoodRatio)
      return std::nullopt;
  if (image_tilt(views, best.second.down) > kMaxImageTilt) return std::nullopt;
  return best.second;
}

std::optional<GravityCandidate> refine_gravity(std::span<const StructureView> views, const Vector3d& measured) {
  const Surfaces surfaces = gather_surfaces(views);
  if (surfaces.facings.empty()) return std::nullopt;
  const GravityCandidate found = evaluate(surfaces, fit(surfaces, measured));
  if (found.min_constraint < kMinConstraintShare || found.down.cross(measured).norm() > std::sin(kMaxMeasuredError))
    return std::nullopt;
  return found;
}

}  // namespace cairn
