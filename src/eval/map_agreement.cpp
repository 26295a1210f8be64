// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "eval/map_agreement.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "eval/frame_pose.hpp"
#include "eval/statistics.hpp"
#include "geometry/velocity.hpp"

namespace cairn {
namespace {

constexpr double kMaxReadoutMotion = 0.02;   // maximum motion in half a readout, meters and radians
constexpr double kSigmas = 4, kVoxels = 3;   // multiples of the depth noise, and of the voxel size
constexpr double kMaxSurfaceDistance = 0.1;  // meters
constexpr double kBorderWidth = 1.5;         // voxels by which a surface ends before the border of its measurements
constexpr int kMaxBorder = 4;                // pixels of the grid

constexpr float kNearPlane = 0.05f;  // meters; nearer triangles are dropped

/// Projected corner of a triangle: pixel and 1/z.
struct Projected {
  float u, v, inverse_z;  // 0: behind the near plane
};

/// Depth test with 1/z for the pixels of a triangle. Most triangles of a map are smaller than a pixel of the grid.
void rasterize(const Projected& a, const Projected& b, const Projected& c, const Camera& grid,
               std::vector<float>& inverse_z) {
  const float area = (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
  if (!(area < 0)) return;  // back face, with rows downward
  const int left = std::max(0, static_cast<int>(std::ceil(std::max(-1.0f, std::min({a.u, b.u, c.u}))))),
            right =
                static_cast<int>(std::floor(std::min(static_cast<float>(grid.width - 1), std::max({a.u, b.u, c.u})))),
            top = std::max(0, static_cast<int>(std::ceil(std::max(-1.0f, std::min({a.v, b.v, c.v}))))),
            bottom =
                static_cast<int>(std::floor(std::min(static_cast<float>(grid.height - 1), std::max({a.v, b.v, c.v}))));
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) {
      const float du = static_cast<float>(x) - a.u, dv = static_cast<float>(y) - a.v;
      const float of_b = (du * (c.v - a.v) - dv * (c.u - a.u)) / area,
                  of_c = ((b.u - a.u) * dv - (b.v - a.v) * du) / area;
      if (of_b < -1e-5f || of_c < -1e-5f || of_b + of_c > 1 + 1e-5f) continue;
      float& at =
          inverse_z[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(x)];
      at = std::max(at, (1 - of_b - of_c) * a.inverse_z + of_b * b.inverse_z + of_c * c.inverse_z);
    }
}

/// Renders the depth of front faces, as render_mesh does; 0: no surface. Takes a twentieth of render_mesh's time, since
/// it renders only depth on a coarse grid.
std::vector<float> render_depth(const std::vector<Mesh>& parts, const Camera& grid,
                                const Eigen::Isometry3d& world_from_camera) {
  const Eigen::Isometry3f camera_from_world = world_from_camera.inverse().cast<float>();
  const auto fx = static_cast<float>(grid.fx), fy = static_cast<float>(grid.fy), cx = static_cast<float>(grid.cx),
             cy = static_cast<float>(grid.cy);
  std::vector<float> depth(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height), 0.0f);
  std::vector<Projected> corners;
  for (const Mesh& part : parts) {
    corners.clear();
    for (const auto& position : part.positions) {
      const Eigen::Vector3f p = camera_from_world * position;
      const float inverse = p.z() > kNearPlane ? 1 / p.z() : 0;
      corners.push_back({fx * p.x() * inverse + cx, fy * p.y() * inverse + cy, inverse});
    }
    for (const auto& t : part.triangles) {
      const Projected &a = corners[t[0]], &b = corners[t[1]], &c = corners[t[2]];
      if (a.inverse_z > 0 && b.inverse_z > 0 && c.inverse_z > 0) rasterize(a, b, c, grid, depth);
    }
  }
  for (float& z : depth) z = z > 0 ? 1 / z : 0;
  return depth;
}

/// Depth of the map in the 3x3 pixels around a measurement, since silhouettes of the map deviate by up to a grid pixel.
struct RenderedDepth {
  double min_depth = 1e9, max_depth = 0;  // range over the nine pixels
  double nearest = 1e9;                   // smallest difference to the measurement
  bool is_complete = true;                // surface in all nine pixels
};

RenderedDepth rendered_at(const std::vector<float>& depth, const Camera& grid, int x, int y, double measured) {
  RenderedDepth rendered;
  for (int v = std::max(0, y - 1); v <= std::min(grid.height - 1, y + 1); ++v)
    for (int u = std::max(0, x - 1); u <= std::min(grid.width - 1, x + 1); ++u) {
      const auto d = static_cast<double>(
          depth[static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(u)]);
      if (!(d > 0)) {
        rendered.is_complete = false;
        continue;
      }
      rendered.min_depth = std::min(rendered.min_depth, d), rendered.max_depth = std::max(rendered.max_depth, d);
      rendered.nearest = std::min(rendered.nearest, std::abs(d - measured));
    }
  return rendered;
}

/// True if all pixels within a surface's border around a pixel have depth in the sample.
bool is_interior(const std::vector<float>& measured, const Camera& grid, int x, int y, double voxel_size) {
  const auto z = static_cast<double>(
      measured[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(x)]);
  const int border = std::clamp(static_cast<int>(std::ceil(kBorderWidth * voxel_size * grid.fx / z)), 1, kMaxBorder);
  if (x < border || y < border || x >= grid.width - border || y >= grid.height - border) return false;
  for (int v = y - border; v <= y + border; ++v)
    for (int u = x - border; u <= x + border; ++u)
      if (!(measured[static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(u)] >
            0))
        return false;
  return true;
}

}  // namespace

double DepthTolerance::at(double depth) const {
  return std::max(kSigmas * static_cast<double>(sensor.sigma(static_cast<float>(depth))), kVoxels * voxel_size);
}

std::vector<PlacedSample> placed_samples(const FrameSamples& samples, double readout,
                                         const std::vector<Trajectory>& trajectories, double clock_offset) {
  std::vector<PlacedSample> placed;
  for (const FrameSample* sample : samples.all()) {
    if (static_cast<std::size_t>(sample->recording) >= trajectories.size()) continue;
    const Trajectory& poses = trajectories[static_cast<std::size_t>(sample->recording)];
    const double time = sample->timestamp + clock_offset;
    const auto pose = frame_pose(poses, time);
    if (!pose || velocity_at(poses, time).norm() * readout / 2 > kMaxReadoutMotion) continue;
    placed.push_back({sample, *pose});
  }
  return placed;
}

namespace {

/// Counts of one sample.
struct Compared {
  double points = 0, in_front = 0, missing = 0;
  std::vector<double> errors;  // meters, of the same surface
};

Compared compare(const std::vector<Mesh>& parts, const Camera& grid, const DepthCorrection& correction,
                 const DepthTolerance& tolerance, const PlacedSample& placed) {
  Compared compared;
  std::vector<float> measured(placed.sample->depth.size());
  for (std::size_t i = 0; i < measured.size(); ++i) measured[i] = static_cast<float>(placed.sample->at(i));
  correction.apply(grid.width, grid.height, measured);
  const std::vector<float> rendered = render_depth(parts, grid, placed.world_from_camera);
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const auto z = static_cast<double>(measured[i]);
    if (!(z > 0)) continue;
    const int x = static_cast<int>(i) % grid.width, y = static_cast<int>(i) / grid.width;
    if (!is_interior(measured, grid, x, y, tolerance.voxel_size)) continue;
    const RenderedDepth around = rendered_at(rendered, grid, x, y, z);
    const double limit = tolerance.at(z);
    ++compared.points;
    compared.in_front += around.is_complete && around.max_depth < z - limit;
    compared.missing += around.nearest > limit && !(around.min_depth <= z && z <= around.max_depth);
    if (const double error = std::abs(static_cast<double>(rendered[i]) - z);
        rendered[i] > 0 && error < kMaxSurfaceDistance)
      compared.errors.push_back(error);
  }
  return compared;
}

}  // namespace

DepthAgreement compare_depth(const std::vector<Mesh>& parts, const Camera& grid, const DepthCorrection& correction,
                             const DepthTolerance& tolerance, const std::vector<PlacedSample>& samples) {
  std::vector<Compared> all(samples.size());
  tbb::parallel_for(std::size_t{0}, samples.size(),
                    [&](std::size_t i) { all[i] = compare(parts, grid, correction, tolerance, samples[i]); });
  DepthAgreement agreement{.frames = static_cast<int>(samples.size())};
  std::vector<double> errors;
  for (const Compared& c : all) {
    agreement.points += c.points, agreement.in_front += c.in_front, agreement.missing += c.missing;
    errors.insert(errors.end(), c.errors.begin(), c.errors.end());
  }
  if (agreement.points > 0) agreement.in_front /= agreement.points, agreement.missing /= agreement.points;
  const ErrorStatistics of_errors = statistics(std::move(errors));
  agreement.median = of_errors.median, agreement.rmse = of_errors.rmse;
  return agreement;
}

}  // namespace cairn
