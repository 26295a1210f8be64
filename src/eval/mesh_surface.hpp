// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numeric>
#include <unsupported/Eigen/BVH>
#include <vector>

#include "cairn/mapping/mesh.hpp"

namespace cairn {

/// Vector from the nearest point of a triangle to p (Ericson 2005, Real-Time Collision Detection, 5.1.5).
inline Eigen::Vector3f from_triangle(const Eigen::Vector3f& p, const Eigen::Vector3f& a, const Eigen::Vector3f& b,
                                     const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a;
  Eigen::Vector3f ap = p - a;
  const float d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return ap;
  Eigen::Vector3f bp = p - b;
  const float d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return bp;
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return ap - d1 / (d1 - d3) * ab;
  Eigen::Vector3f cp = p - c;
  const float d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return cp;
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return ap - d2 / (d2 - d6) * ac;
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const float scale = 1.0f / (va + vb + vc);
  return ap - vb * scale * ab - vc * scale * ac;
}

/// Distance queries on a mesh, which must outlive this object.
class MeshSurface {
 public:
  explicit MeshSurface(const Mesh& mesh) : mesh_(mesh) {
    std::vector<int> objects(mesh.triangles.size());
    std::iota(objects.begin(), objects.end(), 0);
    std::vector<Eigen::AlignedBox3f> boxes(objects.size());
    for (std::size_t i = 0; i < boxes.size(); ++i)
      for (const auto v : mesh.triangles[i]) boxes[i].extend(mesh.positions[v]);
    tree_.init(objects.begin(), objects.end(), boxes.begin(), boxes.end());
  }

  [[nodiscard]] double distance(const Eigen::Vector3f& point) const {
    return std::sqrt(static_cast<double>(nearest(point).squared_distance));
  }
  struct Nearest {
    std::size_t triangle = 0;
    float squared_distance = std::numeric_limits<float>::infinity();
  };
  [[nodiscard]] Nearest nearest(const Eigen::Vector3f& point) const {
    struct Search {
      using Scalar = float;
      const Mesh& mesh;
      const Eigen::Vector3f& p;
      Nearest found;
      float minimumOnVolume(const Eigen::AlignedBox3f& box) const { return box.squaredExteriorDistance(p); }
      float minimumOnObject(int i) {
        const auto triangle = static_cast<std::size_t>(i);
        const auto& t = mesh.triangles[triangle];
        const float d =
            from_triangle(p, mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]).squaredNorm();
        if (d < found.squared_distance) found = {triangle, d};
        return d;
      }
    } search{mesh_, point, {}};
    Eigen::BVMinimize(tree_, search);
    return search.found;
  }

 private:
  const Mesh& mesh_;
  Eigen::KdBVH<float, 3, int> tree_;
};

}  // namespace cairn
