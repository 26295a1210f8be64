// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/fields.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "volume/vdb/map_vdb.hpp"

namespace cairn {
namespace {

constexpr float kMaxDistance = 2;       // meters, as in EsdfOptions
constexpr float kMargin = 0.02f;        // voxels, as in esdf_sites.comp
constexpr float kMinWeight = 0.1f;      // of a surface, as FuseOptions::min_mesh_weight
constexpr std::size_t kMaxPoses = 200;  // maximum number of poses used to estimate viewing distances
constexpr float kMaxViewAngle =
    0.6f;  // radians around the optical axis; a Kinect's 57 x 43 degrees are 0.6 to a corner
constexpr float kUnknown = std::numeric_limits<float>::max();

struct Cell {
  Eigen::Vector3f site = Eigen::Vector3f::Zero();  // nearest known surface point, world
  float squared = kUnknown;                        // distance to the site from the cell center, squared
  float sum = 0;                                   // of distances in the cell
  int observed = 0;                                // cubes of 2x2x2 voxels
  float weight = 0, surface_weight = 0;            // sums
  int surfaces = 0;                                // cubes with surface
};

/// A cube of eight voxels in a brick, with a plane fitted to their distances. Free voxels without observations count as
/// at truncation distance in front of a surface.
struct Cube {
  int seen = 0, free = 0;                                  // observed voxels, and free voxels
  float min_weight = kUnknown, mean_weight = 0, mean = 0;  // mean: meters
  Eigen::Vector3f gradient = Eigen::Vector3f::Zero();      // meters per voxel
};
Cube cube_at(const MapFile::Voxels& voxels, float truncation, int x, int y, int z) {
  Cube cube;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3i at(corner >> 2, corner >> 1 & 1, corner & 1);
    const auto n = static_cast<std::size_t>((x + at.x()) << 6 | (y + at.y()) << 3 | (z + at.z()));
    const bool is_free = (voxels.free[n >> 6] >> (n & 63) & 1) != 0;
    const float distance = is_free ? truncation : voxels.distances[n], weight = is_free ? 1 : voxels.weights[n];
    cube.free += is_free;
    cube.seen += voxels.weights[n] > 0;
    cube.min_weight = std::min(cube.min_weight, weight);
    cube.mean_weight += weight / 8;
    cube.mean += distance / 8;
    cube.gradient += (2 * at.array() - 1).matrix().cast<float>() * distance / 4;
  }
  return cube;
}

class Grid {
 public:
  Grid(const BrickBox& bricks, const GridInfo& info, std::size_t max_cells)
      : voxel_size_(info.voxel_size),
        truncation_(info.truncation),
        world_from_voxels_(info.upright.world_from_tracked.cast<float>()) {
    Eigen::AlignedBox3f box;  // of the voxels' corners, world
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Array3i is_high(corner >> 2, corner >> 1 & 1, corner & 1);
      const Eigen::Array3i brick = bricks.min().array() + is_high * (bricks.sizes().array() + 1);
      box.extend(world_of((8 * brick).cast<float>() - 0.5f));
    }
    low_ = box.min();
    do {
      scale_ += 2;
      size_ = (box.sizes() / spacing() - Eigen::Vector3f::Constant(1e-3f)).array().ceil().cast<int>().max(1);
    } while (size_.cast<double>().prod() > static_cast<double>(max_cells));
    cells_.resize(static_cast<std::size_t>(size_.prod()));
  }

  void add(const Eigen::Vector3i& brick, const MapFile::Voxels& voxels) {
    for (int x = 0; x < 8; x += 2)
      for (int y = 0; y < 8; y += 2)
        for (int z = 0; z < 8; z += 2) {
          const Cube cube = cube_at(voxels, truncation_, x, y, z);
          if (cube.seen + cube.free == 8) add(8 * brick + Eigen::Vector3i(x, y, z), cube);
        }
  }

  /// Propagates the nearest surface point of each cell to its neighbors in forward and backward sweeps, each from the
  /// 13 preceding neighbors. A second pair of sweeps covers paths around corners.
  void propagate() {
    const Eigen::Vector3i last = size_.array() - 1;
    for (const int sign : {1, -1, 1, -1}) {
      for (int k = 0; k < size_.z(); ++k)
        for (int j = 0; j < size_.y(); ++j) {
          const auto at = [&](int i) -> Eigen::Vector3i {
            return sign > 0 ? Eigen::Vector3i(i, j, k) : Eigen::Vector3i(last - Eigen::Vector3i(i, j, k));
          };
          for (int i = 0; i < size_.x(); ++i)
            for (int n = 0; n < 13; ++n)
              take(at(i), at(i) + sign * Eigen::Vector3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1));
          for (int i = size_.x() - 2; i >= 0; --i) take(at(i), at(i + 1));
        }
    }
  }

  [[nodiscard]] Fields fields(const SensorModel& sensor, const Trajectory& path) const;

 private:
  [[nodiscard]] std::size_t index(const Eigen::Vector3i& c) const {
    return static_cast<std::size_t>(c.x()) +
           static_cast<std::size_t>(size_.x()) *
               (static_cast<std::size_t>(c.y()) +
                static_cast<std::size_t>(size_.y()) * static_cast<std::size_t>(c.z()));
  }
  [[nodiscard]] bool contains(const Eigen::Vector3i& c) const {
    return (c.array() >= 0).all() && (c.array() < size_.array()).all();
  }
  [[nodiscard]] float spacing() const { return voxel_size_ * static_cast<float>(scale_); }
  [[nodiscard]] Eigen::Vector3f origin() const { return low_.array() + 0.5f * spacing(); }
  /// World position of voxel coordinates.
  [[nodiscard]] Eigen::Vector3f world_of(const Eigen::Array3f& voxel) const {
    return world_from_voxels_ * Eigen::Vector3f(voxel_size_ * voxel);
  }
  [[nodiscard]] Eigen::Vector3f center(const Eigen::Vector3i& c) const {
    return origin() + spacing() * c.cast<float>();
  }

  void add(const Eigen::Vector3i& voxel, const Cube& cube) {
    const Eigen::Array3f middle = voxel.cast<float>().array() + 0.5f;
    const Eigen::Array3i at = ((world_of(middle) - low_).array() / spacing()).floor().cast<int>();
    const Eigen::Vector3i c = at.max(0).min(size_.array() - 1);
    Cell& cell = cells_[index(c)];
    ++cell.observed;
    cell.sum += cube.mean;
    cell.weight += cube.mean_weight;
    const float slope = cube.gradient.norm();
    const bool passes = cube.free == 0 && cube.min_weight >= kMinWeight && slope > 1e-3f * voxel_size_ &&
                        std::abs(cube.mean) <= cube.gradient.lpNorm<1>() + kMargin * slope;
    if (!passes) return;
    ++cell.surfaces;
    cell.surface_weight += cube.mean_weight;
    const Eigen::Vector3f site = world_of(middle - cube.gradient.array() * (cube.mean / (slope * slope)));
    for (int n = 0; n < 27; ++n) offer(c + Eigen::Vector3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1), site);
  }
  void offer(const Eigen::Vector3i& to, const Eigen::Vector3f& site) {
    if (!contains(to)) return;
    Cell& cell = cells_[index(to)];
    const float squared = (center(to) - site).squaredNorm();
    if (squared < cell.squared) cell.squared = squared, cell.site = site;
  }
  void take(const Eigen::Vector3i& to, const Eigen::Vector3i& from) {
    if (!contains(from)) return;
    if (const Cell& cell = cells_[index(from)]; cell.squared < kUnknown) offer(to, cell.site);
  }
  [[nodiscard]] float mean_surface_weight(const Eigen::Vector3i& c) const;

  float voxel_size_, truncation_;
  Eigen::Quaternionf world_from_voxels_;
  int scale_ = 0;                                  // voxels
  Eigen::Vector3f low_ = Eigen::Vector3f::Zero();  // corner of the first cell
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<Cell> cells_;
};

std::uint8_t byte_of(float value, float min_value = 1) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, min_value, 255.0f)));
}

/// Noise term of a surface measurement, sum(w^2 sigma^2) / sum(w) over the viewing distances; see make_fields.
class ViewingNoise {
 public:
  ViewingNoise(const SensorModel& sensor, const Trajectory& path) : sensor_(sensor) {
    const std::size_t step = path.size() / kMaxPoses + 1;
    for (std::size_t i = 0; i < path.size(); i += step)
      camera_from_world_.push_back(path[i].world_from_camera.inverse().cast<float>());
  }
  [[nodiscard]] float operator()(const Eigen::Vector3f& point) const {
    float cost = 0, weights = 0;
    for (const Eigen::Isometry3f& camera_from_world : camera_from_world_) {
      const Eigen::Vector3f p = camera_from_world * point;
      if (p.z() < sensor_.min_depth || p.z() > sensor_.max_depth ||
          p.head<2>().norm() > std::tan(kMaxViewAngle) * p.z())
        continue;
      cost += cost_at(p.z()) * weight_at(p.z());
      weights += weight_at(p.z());
    }
    return weights > 0 ? cost / weights : cost_at(1);
  }

 private:
  [[nodiscard]] float weight_at(float z) const {
    return sensor_.weight == SensorModel::Weight::by_noise ? std::min(1.0f, sensor_.sigma(1) / sensor_.sigma(z))
                                                           : 1 / std::max(1.0f, z * z);
  }
  [[nodiscard]] float cost_at(float z) const { return weight_at(z) * sensor_.sigma(z) * sensor_.sigma(z); }
  SensorModel sensor_;
  std::vector<Eigen::Isometry3f> camera_from_world_;
};

/// Mean surface weight in the cell, or else in the adjacent cells; 0 without surface.
float Grid::mean_surface_weight(const Eigen::Vector3i& c) const {
  float sum = 0;
  int count = 0;
  for (int n = 0; n < 27; ++n) {
    const Eigen::Vector3i other = c + Eigen::Vector3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
    if (!contains(other)) continue;
    const Cell& cell = cells_[index(other)];
    if (n == 13 && cell.surfaces > 0) return cell.surface_weight / static_cast<float>(cell.surfaces);
    sum += cell.surface_weight;
    count += cell.surfaces;
  }
  const Cell& own = cells_[index(c)];
  if (own.surfaces > 0) return own.surface_weight / static_cast<float>(own.surfaces);
  return count > 0 ? sum / static_cast<float>(count) : 0;
}

Fields Grid::fields(const SensorModel& sensor, const Trajectory& path) const {
  Fields f{.size = size_, .origin = origin(), .spacing = spacing(), .max_distance = kMaxDistance};
  for (auto* bytes : {&f.distance, &f.weight, &f.sigma}) bytes->resize(cells_.size());
  const ViewingNoise viewing_noise(sensor, path);
  const int half = std::max(1, scale_ * scale_ * scale_ / 16);  // of the cubes in a cell
  tbb::parallel_for(0, size_.z(), [&](int k) {
    for (int j = 0; j < size_.y(); ++j)
      for (int i = 0; i < size_.x(); ++i) {
        const Eigen::Vector3i c(i, j, k);
        const std::size_t n = index(c);
        const Cell& cell = cells_[n];
        if (cell.observed >= half) {
          const float distance =
              std::min(cell.squared < kUnknown ? std::sqrt(cell.squared) : kMaxDistance, kMaxDistance);
          f.distance[n] = byte_of(128 + 127 / kMaxDistance * (cell.sum < 0 ? -distance : distance));
        }
        const float surface = mean_surface_weight(c);
        if (surface > 0) {
          f.weight[n] = byte_of(surface);
          f.sigma[n] = byte_of(1e4f * std::sqrt(viewing_noise(cell.site) / surface));
        } else if (cell.observed > 0) {
          f.weight[n] = byte_of(cell.weight / static_cast<float>(cell.observed));
        }
      }
  });
  return f;
}

template <class Value>
void append(std::string& bytes, const Value& value) {
  static_assert(sizeof value == 4);
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

Fields make_fields(const std::filesystem::path& vdb, const SensorModel& sensor, const Trajectory& path,
                   std::size_t max_cells) {
  const MapFile map(vdb);
  const BrickBox bounds = map.bounds();
  if (bounds.isEmpty()) return {};
  Grid grid(bounds, map.info(), max_cells);
  map.visit([&](const Eigen::Vector3i& brick, const MapFile::Voxels& voxels) { grid.add(brick, voxels); });
  grid.propagate();
  return grid.fields(sensor, path);
}

std::string bytes_of(const Fields& f) {
  std::string bytes = "CFLD";
  append(bytes, std::uint32_t{1});
  for (const int n : f.size) append(bytes, static_cast<std::uint32_t>(n));
  for (const float x : f.origin) append(bytes, x);
  append(bytes, f.spacing);
  append(bytes, f.max_distance);
  for (const auto* values : {&f.distance, &f.weight, &f.sigma})
    bytes.append(reinterpret_cast<const char*>(values->data()), values->size());
  return bytes;
}

}  // namespace cairn
