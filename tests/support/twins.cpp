// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/twins.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "shaders/surface.h"
#include "volume/polygonize.hpp"

namespace cairn::twin {
namespace {

float at_clamped(const std::vector<float>& image, const Camera& c, int x, int y) {
  return image[static_cast<std::size_t>(std::clamp(y, 0, c.height - 1) * c.width + std::clamp(x, 0, c.width - 1))];
}

bool between(float a, float z, float b, float jump) {
  return a > 0 && b > 0 && (a - z) * (b - z) < 0 && std::abs(a - z) >= jump && std::abs(b - z) >= jump;
}

double inverse_depth(float z) { return 1 / std::max(static_cast<double>(z), 1e-3); }

}  // namespace

Filtered filter(const std::vector<float>& depth, const Camera& c, const SurfaceOptions& o) {
  Filtered out{depth, depth};
  for (int y = 0; y < c.height; ++y)
    for (int x = 0; x < c.width; ++x) {
      const auto at = [&](int dx, int dy) { return at_clamped(depth, c, x + dx, y + dy); };
      float z = at(0, 0);
      if (z < o.min_depth || z > o.max_depth) z = 0;
      const float sigma = SensorModel{}.sigma(z), jump = o.edge_slope * sigma;
      if (between(at(-1, 0), z, at(1, 0), jump) || between(at(0, -1), z, at(0, 1), jump)) z = 0;
      const double q = inverse_depth(z);
      double sum = 0, weights = 0;
      for (int dy = -2; dy <= 2; ++dy)
        for (int dx = -2; dx <= 2; ++dx) {
          const double d = inverse_depth(at(dx, dy)) - q, e = d / (o.filter_range * sigma * q * q);
          const double biweight = std::pow(std::max(1 - e * e, 0.0), 2);
          const double w =
              biweight * std::exp(-0.5 * (dx * dx + dy * dy) / (o.filter_sigma_pixels * o.filter_sigma_pixels));
          sum += w * d;
          weights += w;
        }
      const auto i = static_cast<std::size_t>(y * c.width + x);
      out.clean[i] = z;
      out.smooth[i] = z > 0 ? static_cast<float>(1 / (q + sum / weights)) : 0.0f;
    }
  return out;
}

std::vector<float> half(const std::vector<float>& fine, const Camera& c) {
  const int width = c.width / 2, height = c.height / 2;
  std::vector<float> coarse(static_cast<std::size_t>(width * height), 0.0f);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      std::vector<double> q;
      for (int k = 0; k < 4; ++k)
        if (const float z = at_clamped(fine, c, 2 * x + k % 2, 2 * y + k / 2); z > 0) q.push_back(1 / z);
      if (q.empty()) continue;
      const double first = q[0], limit = 12 * SensorModel{}.sigma(static_cast<float>(1 / first)) * first * first;
      std::erase_if(q, [&](double other) { return std::abs(other - first) > limit; });
      const double sum = std::accumulate(q.begin(), q.end(), 0.0);
      coarse[static_cast<std::size_t>(y * width + x)] = static_cast<float>(static_cast<double>(q.size()) / sum);
    }
  return coarse;
}

std::vector<Eigen::Vector3f> normals(const std::vector<float>& depth, const Camera& c) {
  std::vector<Eigen::Vector3f> out(depth.size(), Eigen::Vector3f::Zero());
  for (int y = 1; y + 1 < c.height; ++y)
    for (int x = 1; x + 1 < c.width; ++x) {
      const float z = at_clamped(depth, c, x, y);
      const double jump = 12 * z / c.fx + 3 * SensorModel{}.sigma(z);
      bool connected = z > 0;
      for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        const float other = at_clamped(depth, c, x + dx, y + dy);
        connected = connected && other > 0 && std::abs(other - z) < jump;
      }
      if (!connected) continue;
      const auto point = [&](int u, int v) -> Eigen::Vector3d { return c.ray(u, v) * at_clamped(depth, c, u, v); };
      out[static_cast<std::size_t>(y * c.width + x)] =
          (point(x, y + 1) - point(x, y - 1)).cross(point(x + 1, y) - point(x - 1, y)).normalized().cast<float>();
    }
  return out;
}

void integrate(Voxel& v, const Eigen::Vector3d& p, const std::vector<float>& depth,
               const std::vector<std::uint32_t>& color, const Camera& c, const FuseOptions& o) {
  if (p.z() <= 0) return;
  const Eigen::Vector2d pixel = c.project(p).array() + 0.5;
  if (pixel.minCoeff() < 0 || pixel.x() >= c.width || pixel.y() >= c.height) return;
  const auto i = static_cast<std::size_t>(static_cast<int>(pixel.y()) * c.width + static_cast<int>(pixel.x()));
  const float z = depth[i], sdf = (z - static_cast<float>(p.z())) / o.truncation;
  if (z <= 0 || sdf <= -1) return;
  const float w = 1 / std::max(1.0f, z * z);
  v.distance = (v.distance * v.weight + std::min(sdf, 1.0f) * w) / (v.weight + w);
  v.weight = std::min(v.weight + w, o.max_weight);
  if (color.empty() || sdf >= 1) return;
  for (int k = 0; k < 3; ++k)
    v.color[k] =
        (v.color[k] * v.color_weight + static_cast<float>((color[i] >> (8 * k)) & 0xff)) / (v.color_weight + 1);
  v.color_weight += 1;
}

BrickBits free_voxels(const Brick& brick, const std::vector<float>& depth, const Camera& c,
                      const Eigen::Isometry3d& submap_from_camera, const FuseOptions& o) {
  BrickBits bits{};
  for (int i = 0; i < 512; ++i) {
    const Eigen::Vector3d voxel = (8 * brick + Brick(i >> 6, i >> 3 & 7, i & 7)).cast<double>();
    const Eigen::Vector3d p = submap_from_camera.inverse() * (static_cast<double>(o.voxel_size) * voxel);
    if (p.z() <= 0) continue;
    const Eigen::Vector2d pixel = c.project(p).array() + 0.5;
    if (pixel.minCoeff() < 0 || pixel.x() >= c.width || pixel.y() >= c.height) continue;
    float min_depth = std::numeric_limits<float>::infinity();
    for (int k = 0; k < 4; ++k) {
      const int u = std::min(static_cast<int>(pixel.x()) / 2 * 2 + (k & 1), c.width - 1),
                v = std::min(static_cast<int>(pixel.y()) / 2 * 2 + (k >> 1), c.height - 1);
      min_depth = std::min(min_depth, depth[static_cast<std::size_t>(v * c.width + u)]);
    }
    if (p.z() < static_cast<double>(min_depth - o.truncation))
      bits[static_cast<std::size_t>(i >> 6)] |= 1ull << (i & 63);
  }
  return bits;
}

std::vector<Eigen::Vector3f> polygonize(const BrickTree& tree, const FuseOptions& o) {
  const auto table = marching_cubes_table();
  const auto voxel = [&](const Eigen::Vector3i& v) -> std::uint64_t {
    const Brick brick = v.unaryExpr([](int i) { return i >> 3; });
    const std::uint64_t* found = tree.find(brick);
    return found == nullptr ? 0 : found[(v.x() & 7) << 6 | (v.y() & 7) << 3 | (v.z() & 7)];
  };
  const auto corner = [](std::uint32_t c) {
    return Eigen::Vector3i(static_cast<int>(c & 1), static_cast<int>(c >> 1 & 1), static_cast<int>(c >> 2 & 1));
  };
  std::vector<Eigen::Vector3f> corners;
  for (const Brick& brick : tree.bricks())
    for (int i = 0; i < 512; ++i) {
      const Eigen::Vector3i cell = 8 * brick + Brick(i >> 6, i >> 3 & 7, i & 7);
      std::uint32_t inside = 0;
      bool all_observed = true;
      for (std::uint32_t c = 0; c < 8; ++c) {
        const std::uint64_t v = voxel(cell + corner(c));
        all_observed = all_observed && shader::voxel_weight(v) >= o.min_mesh_weight;
        if (shader::voxel_distance(v) < 0) inside |= 1u << c;
      }
      if (!all_observed) continue;
      const std::uint32_t* row = &table[16 * std::size_t{inside}];
      for (std::uint32_t k = 0; k < 3 * row[0]; ++k) {
        const std::uint32_t edge = row[1 + k];
        const Eigen::Vector3i a = cell + corner(edge & 7), b = a + Eigen::Vector3i::Unit(edge >> 3);
        const float da = shader::voxel_distance(voxel(a)), db = shader::voxel_distance(voxel(b));
        const float t = std::clamp(da / (da - db), 0.001f, 0.999f);
        corners.emplace_back(o.voxel_size * (a.cast<float>() + t * (b - a).cast<float>()));
      }
    }
  return corners;
}

std::vector<Brick> bands(const std::vector<float>& depth, const Camera& c, const Eigen::Isometry3d& pose,
                         const FuseOptions& o, int stride, int phase_x, int phase_y) {
  std::vector<Brick> bricks;
  const int steps = static_cast<int>(std::ceil(o.truncation / (4 * o.voxel_size) - 0.01f));
  for (int y = phase_y; y < c.height; y += stride)
    for (int x = phase_x; x < c.width; x += stride) {
      const double z = depth[static_cast<std::size_t>(y * c.width + x)];
      for (int k = -steps; k <= steps && z > 0; ++k) {
        const Eigen::Vector3d p = pose * (c.ray(x, y) * (z + k * o.truncation / static_cast<double>(steps)));
        bricks.emplace_back((p / o.voxel_size).array().round().cast<int>().unaryExpr([](int i) { return i >> 3; }));
      }
    }
  const auto order = [](const Brick& a, const Brick& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  };
  std::sort(bricks.begin(), bricks.end(), order);
  bricks.erase(std::unique(bricks.begin(), bricks.end()), bricks.end());
  return bricks;
}

std::vector<double> brightness(const std::vector<std::uint32_t>& color) {
  std::vector<double> out;
  for (const std::uint32_t c : color) {
    const double r = c & 0xff, g = c >> 8 & 0xff, b = c >> 16 & 0xff, max_channel = std::max({r, g, b});
    out.push_back(max_channel < 253 && max_channel > 2 ? (0.299 * r + 0.587 * g + 0.114 * b) / 255 : -1);
  }
  return out;
}

Photometric photometric(const std::vector<double>& live, const std::vector<float>& live_depth,
                        const std::vector<double>& key, const std::vector<float>& key_depth, const Camera& c,
                        const Eigen::Isometry3d& key_from_live, double sigma) {
  const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * c.width + x); };
  Photometric out;
  double squared = 0, fitting = 0;
  for (int y = 0; y + 1 < c.height; ++y)
    for (int x = 0; x + 1 < c.width; ++x) {
      const double z = live_depth[at(x, y)];
      if (z <= 0) continue;
      const Eigen::Vector3d q = key_from_live * (c.ray(x, y) * z);
      const Eigen::Vector2d v = c.project(q);
      if (q.z() <= 0.1 || v.minCoeff() < 0 || v.x() >= c.width - 1 || v.y() >= c.height - 1) continue;
      const int u0 = static_cast<int>(v.x()), v0 = static_cast<int>(v.y());
      const double fx = v.x() - u0, fy = v.y() - v0;
      const double k[4] = {key[at(u0, v0)], key[at(u0 + 1, v0)], key[at(u0, v0 + 1)], key[at(u0 + 1, v0 + 1)]};
      const double l[4] = {live[at(x, y)], live[at(x + 1, y)], live[at(x, y + 1)], live[at(x + 1, y + 1)]};
      if (*std::min_element(k, k + 4) < 0 || *std::min_element(l, l + 4) < 0) continue;
      const double zk = key_depth[at(u0, v0)];
      if (zk > 0 && std::abs(zk - q.z()) >= 0.05 + 0.03 * q.z()) continue;
      const double r = (1 - fy) * ((1 - fx) * k[0] + fx * k[1]) + fy * ((1 - fx) * k[2] + fx * k[3]) - l[0];
      squared += 6 / (5 + r * r / (sigma * sigma)) * r * r;
      fitting += std::abs(r) < 2.5 * sigma;
      ++out.seen;
    }
  out.rmse = std::sqrt(squared / out.seen);
  out.share = fitting / out.seen;
  return out;
}

Eigen::Vector3f unpack_normal(std::uint32_t code) {
  if (code == 0) return Eigen::Vector3f::Zero();
  const float x = static_cast<float>(code & 0xffff) / 65535 * 2 - 1, y = static_cast<float>(code >> 16) / 65535 * 2 - 1;
  Eigen::Vector3f n(x, y, 1 - std::abs(x) - std::abs(y));
  const float t = std::max(-n.z(), 0.0f);
  n.x() += n.x() >= 0 ? -t : t;
  n.y() += n.y() >= 0 ? -t : t;
  return n.normalized();
}

Voxel merge(const Eigen::Vector3i& voxel, const std::vector<std::pair<const BrickTree*, Eigen::Isometry3d>>& submaps,
            const FuseOptions& options) {
  const double size = static_cast<double>(options.voxel_size);
  double distance = 0, weight = 0, shade = 0;
  Eigen::Vector3d color = Eigen::Vector3d::Zero();
  for (const auto& [tree, submap_from_world] : submaps) {
    const Eigen::Vector3d at = submap_from_world * (size * voxel.cast<double>()) / size;
    const auto word = [&, bricks = tree](const Eigen::Vector3i& v) -> std::uint64_t {
      const Brick brick = v.unaryExpr([](int i) { return i >> 3; });
      const std::uint64_t* voxels = bricks->find(brick);
      return voxels == nullptr ? 0 : voxels[(v.x() & 7) * 64 + (v.y() & 7) * 8 + (v.z() & 7)];
    };
    const Eigen::Vector3i low = at.array().floor().cast<int>().matrix();
    const Eigen::Vector3d high = at - low.cast<double>();
    // Interpolate along the edges of the cell's tetrahedron around the point: the axis of the largest share first.
    std::array<int, 3> axes{0, 1, 2};
    std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return high[a] > high[b]; });
    Eigen::Vector3i corner = low;
    double d = 0, w = 0;
    double unseen = 0;  // share
    for (int k = 0; k <= 3; ++k) {
      const double before = k == 0 ? 1 : high[axes[static_cast<std::size_t>(k - 1)]];
      const double after = k == 3 ? 0 : high[axes[static_cast<std::size_t>(k)]];
      const std::uint64_t v = word(corner);
      const auto observations = static_cast<double>(shader::voxel_weight(v));
      unseen += observations > 0 ? 0 : before - after;
      d += (before - after) * static_cast<double>(shader::voxel_distance(v));
      w += (before - after) * observations;
      if (k < 3) ++corner[axes[static_cast<std::size_t>(k)]];
    }
    if (unseen >= 1e-3) continue;
    distance += w * d;
    weight += w;
    const std::uint64_t nearest = word((at.array() + 0.5).floor().cast<int>().matrix());
    const auto n = static_cast<double>(nearest >> 56);
    shade += n;
    for (int c = 0; c < 3; ++c) color[c] += n * static_cast<double>((nearest >> (32 + 8 * c)) & 0xff);
  }
  if (weight == 0) return {};
  return {.distance = static_cast<float>(distance / weight),
          .weight = static_cast<float>(std::min(weight, static_cast<double>(options.max_weight))),
          .color = (shade > 0 ? color / shade : color).cast<float>(),
          .color_weight = static_cast<float>(std::min(shade, 255.0))};
}

}  // namespace cairn::twin
