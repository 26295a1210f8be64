// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/gravity.hpp"

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
constexpr int kBins = 40;                // histogram bins along a side of the normals' cube: 2 degrees each
constexpr double kApart = 10 * kDegree;  // min. angle between candidates, and between the strongest directions
constexpr std::size_t kStrongest = 10;   // directions to form candidates from
constexpr double kCross = 0.5;           // min. sine of the angle between two directions to use their cross product
constexpr std::array kWindows{10 * kDegree, 7 * kDegree, 5 * kDegree, 4 * kDegree,
                              4 * kDegree,  4 * kDegree, 4 * kDegree, 4 * kDegree};  // Tukey windows of the iterations
constexpr double kCounted = 5 * kDegree;           // max. angle from horizontal or vertical to support a candidate
constexpr double kLevel = 0.04, kStanding = 0.05;  // min. shares of horizontal, vertical surface for a direction
constexpr double kTwoWalls = 0.08;                 // min. share of vertical surface alone
constexpr double kMostOfIt = 0.3;                  // min. share of surface in support of a candidate
constexpr double kHolds = 0.1;                     // min. share to refine a measured direction
constexpr double kMeasured = 4 * kDegree;          // max. error of a measured direction
constexpr double kPitch = 20 * kDegree, kPitches = 30 * kDegree, kLean = 20 * kDegree;  // prior of camera poses
constexpr double kNever = 8;              // max. -log likelihood of a single camera pose
constexpr double kSupport = 2;            // weight of the surface term against the cameras' term
constexpr double kClear = 1;              // min. log likelihood ratio to every other candidate
constexpr double kTipped = 60 * kDegree;  // max. angle between the mean down direction of the images and the estimate

/// Surface whose normal is along a direction, with either sign.
struct Facing {
  Vector3d normal;
  double area;
};

struct Seen {
  std::vector<Facing> facings;
  double area = 0;  // total, including surface without a clear normal
};

/// Gathers the facings in bins on half a cube.
Seen gather(std::span<const StructureView> views) {
  Seen seen;
  std::map<std::array<int, 3>, Vector3d> bins;
  for (const StructureView& view : views) {
    seen.area += static_cast<double>(view.structure->area);
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
    if (const double area = sum.norm(); area > 0) seen.facings.push_back({sum / area, area});
  return seen;
}

/// Tukey's weight of an angle, from its sine.
double weight(double sine, double window) {
  const double u = sine / std::sin(window);
  return u < 1 ? (1 - u * u) * (1 - u * u) : 0;
}

/// Fits a direction to the horizontal and vertical surfaces near it.
Vector3d fit(const Seen& seen, Vector3d down) {
  for (const double window : kWindows) {
    Eigen::Matrix3d off = Eigen::Matrix3d::Zero();  // down^T off down is the sum of squared sines, up to a constant
    for (const auto& [n, area] : seen.facings) {
      const double along = n.dot(down), across = n.cross(down).norm();
      off += area * (weight(std::abs(along), window) - weight(across, window)) * n * n.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(off);
    const Vector3d best = solver.eigenvectors().col(0);
    down = best.dot(down) < 0 ? Vector3d(-best) : best;
  }
  return down;
}

Down judge(const Seen& seen, const Vector3d& down) {
  Down judged{.down = down};
  const Vector3d a = down.unitOrthogonal(), b = down.cross(a);
  Eigen::Matrix2d standing = Eigen::Matrix2d::Zero();
  for (const auto& [n, area] : seen.facings) {
    const double along = weight(std::abs(n.dot(down)), kCounted), across = weight(n.cross(down).norm(), kCounted);
    judged.level += across * area / seen.area;
    judged.upright += along * area / seen.area;
    const Eigen::Vector2d side(n.dot(a), n.dot(b));
    standing += along * area / seen.area * side * side.transpose();
  }
  judged.weakest = judged.level + standing.trace() / 2 -
                   std::hypot((standing(0, 0) - standing(1, 1)) / 2, standing(0, 1));  // smaller eigenvalue
  return judged;
}

/// True if surfaces of at least two directions determine the direction.
bool is_held(const Down& d) {
  const double two_walls = d.weakest - d.level;
  return ((d.level > kLevel && d.upright > kStanding) || two_walls > kTwoWalls) && d.level + d.upright > kMostOfIt;
}

std::vector<Vector3d> candidates(const Seen& seen) {
  std::vector<double> around(seen.facings.size(), 0);
  for (std::size_t i = 0; i < around.size(); ++i)
    for (const auto& [n, area] : seen.facings)
      around[i] += area * weight(n.cross(seen.facings[i].normal).norm(), kCounted);
  std::vector<std::size_t> order(around.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return around[a] > around[b]; });
  std::vector<Vector3d> strongest;
  for (const std::size_t i : order) {
    const Vector3d& n = seen.facings[i].normal;
    const bool is_new = std::all_of(strongest.begin(), strongest.end(),
                                    [&](const Vector3d& s) { return s.cross(n).norm() > std::sin(kApart); });
    if (is_new) strongest.push_back(n);
    if (strongest.size() == kStrongest) break;
  }
  std::vector<Vector3d> all = strongest;
  for (std::size_t i = 0; i < strongest.size(); ++i)
    for (std::size_t k = i + 1; k < strongest.size(); ++k)
      if (const Vector3d cross = strongest[i].cross(strongest[k]); cross.norm() > kCross)
        all.push_back(cross.normalized());
  return all;
}

/// Mean log likelihood of the camera poses for this down direction.
double log_likelihood(std::span<const StructureView> views, const Vector3d& down) {
  double sum = 0;
  for (const StructureView& view : views) {
    const Vector3d d = view.world_from_camera.transpose() * down;  // x right, y down, z forward
    const double pitch = (std::atan2(d.z(), d.y()) - kPitch) / kPitches,
                 lean = std::asin(std::clamp(d.x(), -1.0, 1.0)) / kLean;
    sum -= std::min(kNever, 0.5 * (pitch * pitch + lean * lean));
  }
  return sum / static_cast<double>(views.size());
}

/// Angle in radians between the images' mean down direction and `down`.
double tipped(std::span<const StructureView> views, const Vector3d& down) {
  Vector3d sum = Vector3d::Zero();
  for (const StructureView& view : views) sum += view.world_from_camera.col(1);
  return std::acos(std::clamp(sum.normalized().dot(down), -1.0, 1.0));
}

}  // namespace

std::optional<Down> vote_down(std::span<const StructureView> views) {
  const Seen seen = gather(views);
  if (seen.facings.empty()) return std::nullopt;
  std::vector<std::pair<double, Down>> held;
  for (const Vector3d& candidate : candidates(seen)) {
    Down judged = judge(seen, fit(seen, candidate));
    if (!is_held(judged)) continue;
    const double surface = kSupport * std::log(judged.level + judged.upright);
    const double one = log_likelihood(views, judged.down), other = log_likelihood(views, -judged.down);
    if (other > one) judged.down = -judged.down;
    held.emplace_back(surface + std::max(one, other), judged);
  }
  if (held.empty()) return std::nullopt;
  const auto best =
      *std::max_element(held.begin(), held.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [likely, other] : held)
    if (other.down.cross(best.second.down).norm() > std::sin(kApart) && likely > best.first - kClear)
      return std::nullopt;
  if (tipped(views, best.second.down) > kTipped) return std::nullopt;
  return best.second;
}

std::optional<Down> sharpen_down(std::span<const StructureView> views, const Vector3d& measured) {
  const Seen seen = gather(views);
  if (seen.facings.empty()) return std::nullopt;
  const Down found = judge(seen, fit(seen, measured));
  if (found.weakest < kHolds || found.down.cross(measured).norm() > std::sin(kMeasured)) return std::nullopt;
  return found;
}

}  // namespace cairn
