// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <numeric>
#include <random>
#include <stdexcept>
#include <unsupported/Eigen/BVH>

#include "cairn/evaluation.hpp"
#include "eval/statistics.hpp"

namespace cairn {
namespace {

using Box = Eigen::AlignedBox3f;

/// Squared distance from a point to a triangle (Ericson 2005, Real-Time Collision Detection, 5.1.5).
float squared_distance(const Eigen::Vector3f& p, const Eigen::Vector3f& a, const Eigen::Vector3f& b,
                       const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a, ap = p - a;
  const float d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return ap.squaredNorm();
  const Eigen::Vector3f bp = p - b;
  const float d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return bp.squaredNorm();
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return (ap - d1 / (d1 - d3) * ab).squaredNorm();
  const Eigen::Vector3f cp = p - c;
  const float d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return cp.squaredNorm();
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return (ap - d2 / (d2 - d6) * ac).squaredNorm();
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return (bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)).squaredNorm();
  const float scale = 1.0f / (va + vb + vc);
  return (ap - vb * scale * ab - vc * scale * ac).squaredNorm();
}

class Surface {
 public:
  explicit Surface(const Mesh& mesh) : mesh_(mesh) {
    std::vector<int> objects(mesh.triangles.size());
    std::iota(objects.begin(), objects.end(), 0);
    std::vector<Box> boxes(objects.size());
    for (std::size_t i = 0; i < boxes.size(); ++i)
      for (const auto v : mesh.triangles[i]) boxes[i].extend(mesh.positions[v]);
    tree_.init(objects.begin(), objects.end(), boxes.begin(), boxes.end());
  }

  [[nodiscard]] double distance(const Eigen::Vector3f& point) const {
    struct Nearest {
      using Scalar = float;
      const Mesh& mesh;
      const Eigen::Vector3f& p;
      float minimumOnVolume(const Box& box) const { return box.squaredExteriorDistance(p); }
      float minimumOnObject(int i) const {
        const auto& t = mesh.triangles[static_cast<std::size_t>(i)];
        return squared_distance(p, mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]);
      }
    } nearest{mesh_, point};
    return std::sqrt(static_cast<double>(Eigen::BVMinimize(tree_, nearest)));
  }

 private:
  const Mesh& mesh_;
  Eigen::KdBVH<float, 3, int> tree_;
};

/// Points spread evenly by area: one in each of `count` strata of the cumulated area.
std::vector<Eigen::Vector3f> sample(const Mesh& mesh, int count) {
  std::vector<double> cumulated;
  double area = 0;
  for (const auto& t : mesh.triangles) {
    area +=
        0.5 * (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm();
    cumulated.push_back(area);
  }
  if (!(area > 0)) throw std::runtime_error("the mesh has no surface to evaluate");
  std::mt19937_64 random(1);
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1.0p-53; };
  std::vector<Eigen::Vector3f> points;
  std::size_t i = 0;
  for (int k = 0; k < count; ++k) {
    const double at = area * (k + uniform()) / count;
    while (i + 1 < cumulated.size() && cumulated[i] < at) ++i;
    const auto& t = mesh.triangles[i];
    const double u = std::sqrt(uniform()), v = uniform();  // Osada et al. 2002, eq. 1
    points.emplace_back(static_cast<float>(1 - u) * mesh.positions[t[0]] +
                        static_cast<float>(u * (1 - v)) * mesh.positions[t[1]] +
                        static_cast<float>(u * v) * mesh.positions[t[2]]);
  }
  return points;
}

std::vector<double> distances(const std::vector<Eigen::Vector3f>& points, const Surface& surface) {
  std::vector<double> d(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) { d[i] = surface.distance(points[i]); });
  return d;
}

double share_within(const std::vector<double>& d, double threshold) {
  return static_cast<double>(std::count_if(d.begin(), d.end(), [&](double x) { return x <= threshold; })) /
         static_cast<double>(d.size());
}

}  // namespace

MeshError evaluate_mesh(const Mesh& estimate, const Mesh& truth, int samples, const Mesh* seen) {
  if (samples < 1) throw std::runtime_error("the number of samples must be positive");
  const auto of_estimate = distances(sample(estimate, samples), Surface(truth));
  const auto of_truth = distances(sample(seen != nullptr ? *seen : truth, samples), Surface(estimate));
  MeshError error{.accuracy = statistics(of_estimate), .completeness = statistics(of_truth)};
  constexpr std::array kThresholds{0.01, 0.02, 0.05};
  for (std::size_t i = 0; i < kThresholds.size(); ++i) {
    const double precision = share_within(of_estimate, kThresholds[i]), recall = share_within(of_truth, kThresholds[i]);
    const double sum = precision + recall;
    error.at[i] = {kThresholds[i], precision, recall, sum > 0 ? 2 * precision * recall / sum : 0.0};
  }
  return error;
}

}  // namespace cairn
