// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "session/validate.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <stdexcept>
#include <string_view>

namespace cairn {
namespace {

void require(bool condition, const char* problem) {
  if (!condition) throw std::runtime_error(problem);
}

void require_numbers(std::initializer_list<double> values) {
  require(std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); }),
          "a number is not finite");
}
template <class Matrix>
void require_numbers(const Eigen::MatrixBase<Matrix>& m) {
  require(m.allFinite(), "a number is not finite");
}

void require_rigid(const Eigen::Isometry3d& pose) {
  constexpr double kRotationTolerance = 0.01;  // far above rounding errors
  const Eigen::Matrix3d r = pose.linear();
  require(pose.matrix().allFinite() && (r.transpose() * r - Eigen::Matrix3d::Identity()).norm() < kRotationTolerance &&
              r.determinant() > 0 && pose.matrix().row(3) == Eigen::RowVector4d(0, 0, 0, 1),
          "a pose is not a rigid transform");
}

/// Unit direction, with its area.
void require_unit(const Eigen::Vector3d& direction, float area = 1) {
  constexpr double kRotationTolerance = 0.01;
  require(std::abs(direction.norm() - 1) < kRotationTolerance && area >= 0 && std::isfinite(area),
          "a direction is not a unit vector");
}

void require_near(const Brick& brick) {
  constexpr int kMaxIndex = 1 << 24;  // bricks; no overflow below
  require((brick.array() > -kMaxIndex).all() && (brick.array() < kMaxIndex).all(), "a brick index is out of range");
}

void validate(const Keyframe& keyframe, std::size_t number, std::size_t submaps) {
  require(keyframe.submap <= submaps, "a submap is missing");
  require(keyframe.searched <= number && !(keyframe.follows && number == 0), "a keyframe is missing");
  require_numbers({keyframe.timestamp, keyframe.color_delay});
  require_numbers(keyframe.information);
  if (keyframe.acceleration) require_numbers(*keyframe.acceleration);
  require_numbers(keyframe.accelerations);
  require_numbers({static_cast<double>(keyframe.structure.area)});
  for (const Structure::Facing& f : keyframe.structure.facings) require_unit(f.normal.cast<double>(), f.area);
  require_rigid(keyframe.odometry_from_camera);
  if (keyframe.device_pose) require_numbers(keyframe.device_pose->matrix());
  if (keyframe.device_drift) require_numbers({keyframe.device_drift->rotation, keyframe.device_drift->translation});
  require_rigid(keyframe.submap_from_camera);
}

void validate(const SurfaceSigma& sigma) {
  constexpr int kMaxIndex = 1 << 24;  // cells, the limit of SurfaceSigma
  for (const SurfaceSigma::Cell& cell : sigma.cells()) {
    require_numbers({cell.variance, cell.weight});
    require(cell.variance > 0 && cell.weight > 0, "a standard deviation is not positive");
    require((cell.at.array() > -kMaxIndex).all() && (cell.at.array() < kMaxIndex).all(),
            "a surface cell is out of range");
  }
}

void validate(const AdjustedStep& step) {
  require_numbers(step.information);
  require(step.information.isZero() || step.information.llt().info() == Eigen::Success,
          "an odometry step has an invalid information matrix");
  require_rigid(step.before_from_camera);
}

void validate(const InertialKeyframe& inertial) {
  if (const auto& gravity = inertial.gravity) {
    require_unit(gravity->down);
    require(gravity->sigma > 0 && std::isfinite(gravity->sigma), "a number is not finite");
  }
  if (!inertial.step) return;
  const Preintegration& m = *inertial.step;
  require(m.seconds > 0, "an inertial step has no duration");
  require_numbers({m.bias.gyro.sum(), m.bias.acceleration.sum(), m.seconds, m.rotation.norm(), m.velocity.sum(),
                   m.position.sum(), m.rotation_by_gyro.sum(), m.velocity_by_gyro.sum(),
                   m.velocity_by_acceleration.sum(), m.position_by_gyro.sum(), m.position_by_acceleration.sum()});
  require(m.covariance.allFinite() && m.covariance.llt().info() == Eigen::Success,
          "an inertial step has an invalid covariance matrix");
}

void validate(const Loop& loop, std::size_t keyframes) {
  const PoseGraph::Edge& edge = loop.edge;
  require(edge.i < keyframes && edge.j < keyframes && edge.i != edge.j, "a keyframe is missing");
  require_numbers(edge.information);
  require_rigid(edge.i_from_j);
}

void validate(const BackEnd::State& m, std::size_t frames) {
  const Atlas& atlas = m.atlas;
  const std::size_t keyframes = atlas.keyframes.size();
  for (std::size_t k = 0; k < keyframes; ++k) validate(atlas.keyframes[k], k, m.submaps.size());
  for (const Keyframe& keyframe : atlas.keyframes) validate(keyframe.inertial);
  if (const auto& mount = atlas.inertial_mount) require_numbers({mount->imu_from_camera.norm(), mount->lever.sum()});
  require(atlas.world_from_camera.size() == keyframes, "poses and keyframes do not match");
  for (const Eigen::Isometry3d& pose : atlas.world_from_camera) require_rigid(pose);
  for (const Loop& loop : atlas.loops) validate(loop, keyframes);
  require(!atlas.up || (*atlas.up >= Up::automatic && *atlas.up <= Up::minus_z), "the up axis is unknown");
  if (atlas.frozen_gravity) {
    require(atlas.frozen_gravity->keyframe < keyframes, "a keyframe is missing");
    require(atlas.frozen_gravity->found.source >= GravityAlignment::Source::accelerometer &&
                atlas.frozen_gravity->found.source <= GravityAlignment::Source::unknown,
            "the source of the gravity direction is unknown");
    require_unit(atlas.frozen_gravity->found.down);
  }
  validate(atlas.surface_sigma);
  require(atlas.steps.size() <= keyframes, "steps and keyframes do not match");
  for (const AdjustedStep& step : atlas.steps) validate(step);
  require(atlas.frames.full().empty(), "the state has full chunks of frames");
  validate(atlas.frames.rest(), keyframes);
  require((frames == 0) == (keyframes == 0), "keyframes and frames do not match");
  require(std::is_sorted(atlas.recordings.begin(), atlas.recordings.end()) &&
              (atlas.recordings.empty() || atlas.recordings.back() <= frames),
          "a recording is missing");
  require(m.tracked_from_camera.size() == keyframes, "tracked poses and keyframes do not match");
  for (const auto& pose : m.tracked_from_camera)
    if (pose) require_rigid(*pose);
  if (const auto& full = m.scheduler.full) {
    require(full->keyframes <= keyframes && full->world_from_camera.size() == full->keyframes,
            "poses and keyframes do not match");
    require(full->loops <= atlas.loops.size(), "a loop is missing");
    for (std::size_t k = 0; k < full->loops; ++k)
      require(std::max(atlas.loops[k].edge.i, atlas.loops[k].edge.j) < full->keyframes, "a keyframe is missing");
    for (const Eigen::Isometry3d& pose : full->world_from_camera) require_rigid(pose);
  }
  require(m.searched <= keyframes && m.submap_begin <= keyframes, "a keyframe is missing");
}

void validate(const Tracker::State& t, std::size_t frames) {
  require(t.last.size() <= 2 && t.last.empty() == (frames == 0), "the last frames are missing");
  for (const Tracker::Moment& moment : t.last) {
    require_numbers({moment.timestamp});
    require_rigid(moment.submap_from_camera);
  }
  require_numbers({t.typical.photometric_rmse, t.typical.misfit, t.last_aligned, t.guess_error, t.motion_error});
  if (t.last_guess) require_numbers(t.last_guess->matrix());
  for (const double cost : t.clock_offset_costs) require_numbers({cost});
  for (const double cost : t.focal_costs) require_numbers({cost});
  if (t.device.window) {
    require_numbers({t.device.window->timestamp});
    require_numbers(t.device.window->device.matrix());
    require_rigid(t.device.window->tracked);
  }
  for (const DeviceDrift& window : t.device.windows) require_numbers({window.rotation, window.translation});
  require(t.lost_frames >= 0 && t.lost_views >= 0 && t.clock_offset_frames >= 0 && t.focal_pairs >= 0 &&
              t.frames_of_prediction >= 0 && t.device.contradictions >= 0,
          "a count is below zero");
}

void validate(const PhotometricKeyframe::SavedState& keyframe) {
  require_rigid(keyframe.submap_from_camera);
  require_numbers(keyframe.moment.velocity);
  require_numbers({keyframe.moment.stamp_delay, keyframe.moment.clock_offset});
}

void validate(const std::optional<InertialOdometry::Filter>& filter) {
  if (!filter) return;
  const InertialOdometry::Filter& f = *filter;
  require_numbers({f.timestamp, f.rotation.norm(), f.position.sum(), f.velocity.sum(), f.bias.gyro.sum(),
                   f.bias.acceleration.sum(), f.imu_from_camera.norm(), f.lever.sum(), f.clock});
  require_unit(f.gravity / 9.81);
  require_numbers(f.covariance);
}

void validate(const std::vector<InertialOdometry::TrackedPose>& poses) {
  for (const auto& pose : poses) {
    require_numbers({pose.timestamp});
    require_rigid(pose.world_from_camera);
    require_numbers(pose.covariance);
  }
}

void validate(const InertialOdometry::State& s) {
  for (const AngularRate& r : s.rates) require_numbers({r.timestamp, r.rate.sum()});
  for (const Acceleration& a : s.accelerations) require_numbers({a.timestamp, a.value.sum()});
  for (const auto* filter : {&s.filter, &s.prior, &s.test}) validate(*filter);
  for (const auto* poses : {&s.window, &s.test_poses}) validate(*poses);
  require(s.noise_scale > 0 && std::isfinite(s.noise_scale), "a number is not finite");
  require(!s.test || !s.test_poses.empty(), "a pose is missing");
  require_numbers({s.keyframe.value_or(0)});
}

void validate(const Volume::SavedState& r) {
  require(r.device_last_seen.size() == r.on_device.size() && r.host_last_seen.size() == r.on_host.size(),
          "bricks and their stamps do not match");
  require_near(r.origin);
  for (const auto* bricks : {&r.on_device, &r.on_host})
    for (const Brick& brick : *bricks) require_near(brick);
}

}  // namespace

void validate(const SessionState& s, std::size_t frames) {
  check(s.rig);
  check(options_of(s));
  validate(s.back_end, frames);
  validate(s.tracker.state, frames);
  validate(s.tracker.reference);
  require_rigid(s.tracker.prediction.submap_from_camera);
  const Gyroscope::State& g = s.tracker.gyroscope;
  require_numbers({g.count, g.imu.sum(), g.camera.sum(), g.camera_imu.sum(), g.recent, g.squared_errors, g.squares});
  for (const AngularRate& r : g.samples) require_numbers({r.timestamp, r.rate.sum()});
  validate(s.tracker.inertial);
  validate(s.residency);
  require(s.repeated_images >= 0, "a count is below zero");
  require_numbers({s.last_fused.value_or(0)});
}

void validate(const NamedFiles& files, const BackEnd::State& map) {
  std::size_t keyframe = 0, submap = 0;
  for (const SourceMapFiles& source : files.source_maps) {
    require(source.first_keyframe >= keyframe && source.first_submap >= submap, "parts of the map are out of order");
    require(source.first_keyframe <= map.atlas.keyframes.size() && source.first_submap <= map.submaps.size() &&
                source.keyframes <= map.atlas.keyframes.size() - source.first_keyframe &&
                source.submaps <= map.submaps.size() - source.first_submap,
            "a part of the map is missing");
    keyframe = source.first_keyframe + source.keyframes, submap = source.first_submap + source.submaps;
  }
}

void validate(const FusedFrames::Chunk& frames, std::size_t keyframes) {
  for (const FusedFrame& frame : frames) {
    require(frame.keyframe < keyframes, "a keyframe is missing");
    require_numbers({frame.timestamp});
    require_numbers(frame.twist);
  }
}

std::optional<unsigned long> run_number(const std::string& name) {
  constexpr std::string_view kRun = "run-";
  unsigned long number = 0;
  const char *begin = name.data() + std::min(name.size(), kRun.size()), *end = name.data() + name.size();
  if (!name.starts_with(kRun) || begin == end) return std::nullopt;
  const auto [stop, error] = std::from_chars(begin, end, number);
  if (error != std::errc() || stop != end) return std::nullopt;
  return number;
}

}  // namespace cairn
