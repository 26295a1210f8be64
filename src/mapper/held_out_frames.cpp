// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/held_out_frames.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "geometry/velocity.hpp"
#include "shaders/voxel.h"

namespace cairn {
namespace {

constexpr int kMinFrames = 4;
constexpr double kMaxShare = 0.95;               // of the truncation: distance to a surface
constexpr double kSecondSurfaceDistance = 0.08;  // meters along the ray, on each side of a measurement
constexpr double kMinSurfaceGap = 2.5;           // voxels between two surfaces
constexpr double kRayStep = 0.75;                // voxels
// Tolerances of a change for the worse: noise of a dozen frames, and of fewer fused frames.
constexpr double kErrorTolerance = 0.05;    // relative, of depth, brightness, and their product
constexpr double kCoverTolerance = 0.02;    // share of the points
constexpr double kDoubledTolerance = 0.01;  // same

/// Reader of the voxels around a ray, with the brick of the last voxel at hand.
class VoxelReader {
 public:
  VoxelReader(const BrickTree& tree, const FuseOptions& options) : tree_(tree), options_(options) {}

  /// Packed voxel; 0: unobserved.
  [[nodiscard]] std::uint64_t voxel(const Eigen::Vector3i& at) {
    const Eigen::Vector3i brick = at.unaryExpr([](int i) { return i >> 3; });
    if (!has_brick_ || brick != brick_) brick_ = brick, voxels_ = tree_.find(brick), has_brick_ = true;
    if (voxels_ == nullptr) return 0;
    const std::uint64_t voxel = voxels_[(at.x() & 7) << 6 | (at.y() & 7) << 3 | (at.z() & 7)];
    return shader::voxel_weight(voxel) >= options_.min_mesh_weight ? voxel : 0;
  }
  [[nodiscard]] std::uint64_t nearest(const Eigen::Vector3d& point) {
    return voxel((point / static_cast<double>(options_.voxel_size)).array().round().matrix().cast<int>());
  }
  /// Trilinear signed distance, meters; nullopt if a corner is unobserved.
  [[nodiscard]] std::optional<double> distance(const Eigen::Vector3d& point) {
    const Eigen::Vector3d in_voxels = point / static_cast<double>(options_.voxel_size);
    const Eigen::Vector3d low = in_voxels.array().floor(), share = in_voxels - low;
    const Eigen::Vector3i first = low.cast<int>();
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3i offset(corner & 1, corner >> 1 & 1, corner >> 2);
      const std::uint64_t value = voxel(first + offset);
      if (value == 0) return std::nullopt;
      double weight = 1;
      for (int axis = 0; axis < 3; ++axis) weight *= offset[axis] == 1 ? share[axis] : 1 - share[axis];
      sum += weight * static_cast<double>(shader::voxel_distance(value));
    }
    return sum * static_cast<double>(options_.truncation);
  }

 private:
  const BrickTree& tree_;
  const FuseOptions& options_;
  Eigen::Vector3i brick_;
  const std::uint64_t* voxels_ = nullptr;
  bool has_brick_ = false;
};

/// Sums over the measurements of one frame.
struct Sums {
  double points = 0, covered = 0, squared_depth = 0, doubled = 0, colored = 0, squared_brightness = 0;
  void add(const Sums& other) {
    points += other.points, covered += other.covered, squared_depth += other.squared_depth;
    doubled += other.doubled, colored += other.colored, squared_brightness += other.squared_brightness;
  }
};

/// True if the ray of a measurement at distance `range` meets the front of another surface.
bool is_doubled(VoxelReader& voxels, const Eigen::Vector3d& camera, const Eigen::Vector3d& direction, double range,
                double voxel_size) {
  bool is_in_front = false;
  for (double at = -kSecondSurfaceDistance; at <= kSecondSurfaceDistance; at += kRayStep * voxel_size) {
    const std::uint64_t voxel = voxels.nearest(camera + (range + at) * direction);
    const bool is_positive = voxel != 0 && shader::voxel_distance(voxel) > 0;
    if (is_in_front && voxel != 0 && !is_positive && std::abs(at) > kMinSurfaceGap * voxel_size) return true;
    is_in_front = is_positive;
  }
  return false;
}

double brightness_of(std::uint64_t voxel) {
  const auto color = static_cast<std::uint32_t>(voxel >> 32);
  return ((color & 255) + 2 * (color >> 8 & 255) + (color >> 16 & 255)) / 4.0;
}

/// Pose of the camera at the time of each row.
std::vector<Eigen::Isometry3d> poses_of_rows(Camera grid, double readout, const Eigen::Isometry3d& world_from_camera,
                                             const Vector6d& velocity) {
  std::vector<Eigen::Isometry3d> poses(static_cast<std::size_t>(grid.height), world_from_camera);
  grid.readout = readout;
  if (readout > 0)
    for (std::size_t y = 0; y < poses.size(); ++y)
      poses[y] = world_from_camera * retract(velocity * grid.row_delay(static_cast<double>(y)));
  return poses;
}

Sums compare(const FrameSample& sample, const Camera& grid, const std::vector<Eigen::Isometry3d>& world_from_row,
             const DepthCorrection& correction, const BrickTree& map, const FuseOptions& options) {
  Sums sums;
  VoxelReader voxels(map, options);
  const auto truncation = static_cast<double>(options.truncation), voxel_size = static_cast<double>(options.voxel_size);
  std::vector<float> depth(sample.depth.size());
  for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = static_cast<float>(sample.at(i));
  correction.apply(grid.width, grid.height, depth);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (!(depth[i] > 0)) continue;
    const int x = static_cast<int>(i) % grid.width, y = static_cast<int>(i) / grid.width;
    const Eigen::Isometry3d& world_from_camera = world_from_row[static_cast<std::size_t>(y)];
    const Eigen::Vector3d ray = static_cast<double>(depth[i]) * grid.ray(x, y);
    const Eigen::Vector3d point = world_from_camera * ray;
    ++sums.points;
    const std::optional<double> distance = voxels.distance(point);
    if (!distance || std::abs(*distance) > kMaxShare * truncation) continue;
    ++sums.covered, sums.squared_depth += *distance * *distance;
    sums.doubled += is_doubled(voxels, world_from_camera.translation(), world_from_camera.linear() * ray.normalized(),
                               ray.norm(), voxel_size);
    const std::uint64_t voxel = voxels.nearest(point);
    if (sample.brightness.empty() || std::abs(*distance) >= voxel_size || voxel >> 56 == 0) continue;
    const double difference = (brightness_of(voxel) - sample.brightness[i]) / 255;
    ++sums.colored, sums.squared_brightness += difference * difference;
  }
  return sums;
}

}  // namespace

void HeldOutFrames::add(double timestamp, const FramePyramid& seen, const SurfaceOptions& options) {
  Frame images = seen.images();
  images.timestamp = timestamp, images.held_out = true;
  samples_.add(images, 0, static_cast<double>(options.min_depth), static_cast<double>(options.max_depth));
}

std::optional<HeldOutError> HeldOutFrames::compare(const BrickTree& map, const FuseOptions& options,
                                                   const AddedCalibration& added, const Trajectory& poses) const {
  std::vector<const FrameSample*> samples;
  std::vector<std::vector<Eigen::Isometry3d>> world_from_row;
  for (const FrameSample* sample : samples_.all())
    if (const auto pose = pose_at(poses, sample->timestamp, 0)) {
      samples.push_back(sample);
      world_from_row.push_back(
          poses_of_rows(samples_.camera(), added.readout, *pose, velocity_at(poses, sample->timestamp)));
    }
  if (samples.size() < kMinFrames) return std::nullopt;
  std::vector<Sums> all(samples.size());
  tbb::parallel_for(std::size_t{0}, samples.size(), [&](std::size_t i) {
    all[i] = cairn::compare(*samples[i], samples_.camera(), world_from_row[i], added.correction, map, options);
  });
  Sums sums;
  for (const Sums& of_frame : all) sums.add(of_frame);
  if (sums.covered == 0) return std::nullopt;
  return HeldOutError{.frames = static_cast<int>(samples.size()),
                      .covered = sums.covered / sums.points,
                      .depth_rmse = std::sqrt(sums.squared_depth / sums.covered),
                      .brightness_rmse = sums.colored > 0 ? std::sqrt(sums.squared_brightness / sums.colored) : 0,
                      .doubled = sums.doubled / sums.covered};
}

bool is_confirmed(const HeldOutError& before, const HeldOutError& after) {
  const auto ratio = [](double a, double b) { return b > 0 ? a / b : 1; };
  const double depth = ratio(after.depth_rmse, before.depth_rmse),
               brightness = ratio(after.brightness_rmse, before.brightness_rmse);
  return std::max({depth, brightness, depth * brightness}) <= 1 + kErrorTolerance &&
         after.covered >= before.covered - kCoverTolerance && after.doubled <= before.doubled + kDoubledTolerance;
}

}  // namespace cairn
