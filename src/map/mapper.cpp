// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapper.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string_view>

#include "map/refine.hpp"
#include "surface/preprocess.hpp"
#include "surface/stopwatch.hpp"
#include "track/tracker.hpp"
#include "volume/integrate.hpp"
#include "volume/polygonize.hpp"

namespace cairn {
namespace {

constexpr int kMaxRepeats = 2;

std::string unusable(const Frame& frame, const Camera& camera, const Trajectory& before) {
  const auto pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  if (!frame.problem.empty()) return frame.problem;
  if (frame.depth.size() != pixels) return "the depth image is not of the camera's size";
  const auto [least, most] = std::minmax_element(frame.depth.begin(), frame.depth.end());
  if (*least > 0 && *least == *most) return "every depth is the same: the sensor shows nothing";
  if (!std::isfinite(frame.timestamp)) return "the timestamp is not a number";
  if (!before.empty() && frame.timestamp <= before.back().timestamp) return "the timestamp goes back";
  return {};
}

/// The first camera's pose in a world whose y axis points down.
Eigen::Isometry3d level(const std::optional<Eigen::Vector3d>& acceleration) {
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  if (acceleration && acceleration->norm() > 0)
    world_from_camera.linear() =
        Eigen::Quaterniond::FromTwoVectors(*acceleration, -Eigen::Vector3d::UnitY()).toRotationMatrix();
  return world_from_camera;
}

void tell(const Tracked& tracked, FrameReport& report) {
  const Alignment& a = tracked.alignment;
  report.guess = tracked.guess;
  report.inlier_share = a.inlier_share;
  report.overlap = a.overlap;
  report.rmse = a.rmse;
  report.photometric_share = a.photometric_share;
  report.photometric_rmse = a.photometric_rmse;
  report.unobserved_by_geometry = a.unobserved_by_geometry;
  report.unobserved = a.unobserved;
  report.iterations = a.iterations;
}

}  // namespace

struct Mapper::State {
  State(const Camera& c, const Options& o, Poses p, int device_index)
      : options(o),
        poses(p),
        camera(c),
        device(device_index),
        preprocess(device, c, o.surface, o.track.levels, o.track.finest_level),
        tracker(device, c, preprocess.camera(), o),
        integrate(device, preprocess.camera(), o.surface),
        polygonize(device),
        volume(device, o.fuse, o.surface.max_depth) {
    if (o.refine && p == Poses::tracked) refine.emplace(device, c, o);
  }

  /// Noise never repeats. A driver may deliver one image twice, but not more often.
  bool is_stuck(const Frame& frame) {
    const std::size_t image = std::hash<std::string_view>()(
        {reinterpret_cast<const char*>(frame.depth.data()), frame.depth.size() * sizeof(float)});
    repeats = image == last_image ? repeats + 1 : 0;
    last_image = image;
    return repeats > kMaxRepeats;
  }

  Options options;
  Poses poses;
  Camera camera;
  gpu::Device device;
  Preprocess preprocess;
  Tracker tracker;
  Integrate integrate;
  Polygonize polygonize;
  Volume volume;
  std::optional<Refine> refine;
  Trajectory trajectory;
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // sum over fused frames, in the world
  std::uint32_t stamp = 0;                                 // fused frames
  std::size_t last_image = 0;                              // hash of the last frame's depth
  int repeats = 0;                                         // frames since that image was new
};

Mapper::Mapper(const Camera& camera, const Options& options, Poses poses, int device) {
  check(options);
  state_ = std::make_unique<State>(camera, options, poses, device);
}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;

FrameReport Mapper::add(const Frame& given) {
  State& s = *state_;
  // Colour that is not of the depth image's shape cannot be used; depth alone can.
  std::optional<Frame> depth_alone;
  if (!given.colour.empty() && given.colour.size() != given.depth.size()) {
    depth_alone = given;
    depth_alone->colour.clear();
  }
  const Frame& frame = depth_alone ? *depth_alone : given;
  FrameReport report{
      .index = frame.index, .timestamp = frame.timestamp, .reason = unusable(frame, s.camera, s.trajectory)};
  if (!report.reason.empty()) return report;

  if (s.poses == Poses::tracked && s.is_stuck(frame)) {
    report.reason = "the depth image repeats: the sensor is stuck";
    return report;
  }

  const Surface live = timed(report.stage_ms, "preprocess", [&] { return s.preprocess(frame); });

  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  std::optional<Tracked> tracked;
  if (s.poses == Poses::given) {
    if (!frame.world_from_camera) {
      report.reason = "no pose is given for this time";
      return report;
    }
    world_from_camera = *frame.world_from_camera;
  } else if (s.trajectory.empty()) {
    world_from_camera = level(frame.acceleration);
  } else {
    tracked = s.tracker(frame, live, s.volume, report.stage_ms);
    const Alignment& alignment = tracked->alignment;
    tell(*tracked, report);
    if (!alignment.converged()) {
      s.tracker.reject();
      report.state = FrameState::lost;
      report.reason = alignment.lost;
      return report;
    }
    world_from_camera = alignment.submap_from_camera;
    report.moving =
        timed(report.stage_ms, "track", [&] { return s.tracker.leave_out_moving(live, world_from_camera); });
  }

  const Fused fused =
      timed(report.stage_ms, "fuse", [&] { return s.integrate(live, world_from_camera, s.volume, ++s.stamp); });
  report.touched_bricks = fused.touched;
  report.new_bricks = fused.new_bricks;
  report.state = FrameState::fused;
  if (depth_alone) report.reason = "its colour image is not of the camera's size: depth alone is used";
  if (s.poses == Poses::tracked) s.tracker.accept(frame, live, world_from_camera, tracked ? &*tracked : nullptr);
  if (s.refine) s.refine->add(frame, world_from_camera, tracked ? &tracked->alignment.information : nullptr);
  if (frame.acceleration) s.acceleration += world_from_camera.linear() * *frame.acceleration;
  s.trajectory.push_back({frame.timestamp, world_from_camera});
  return report;
}

Trajectory Mapper::trajectory() const {
  Trajectory trajectory = state_->trajectory;
  for (StampedPose& pose : trajectory) pose.timestamp += state_->tracker.clock_offset();
  return trajectory;
}

Refined Mapper::refine(const std::filesystem::path& graph_file) {
  return state_->refine ? (*state_->refine)(state_->trajectory, graph_file) : Refined{.trajectory = state_->trajectory};
}

Mesh Mapper::mesh() { return state_->polygonize(state_->volume); }

void Mapper::write_map(const std::filesystem::path& file) {
  write_grids(file, state_->volume.on_host(),
              {.voxel_size = state_->options.fuse.voxel_size, .truncation = state_->options.fuse.truncation});
}

Mapper::Statistics Mapper::statistics() const {
  const auto& counts = state_->volume.counts();
  Statistics statistics{.device = state_->device.info().name,
                        .device_memory_peak = state_->device.peak_memory(),
                        .bricks = counts.allocated,
                        .paged_out = counts.paged_out,
                        .paged_in = counts.paged_in,
                        .clock_offset = state_->tracker.clock_offset(),
                        .focal = state_->tracker.focal(),
                        .tilt = {},
                        .kernels = {}};
  if (const Eigen::Vector3d& up = state_->acceleration; up.norm() > 0)
    statistics.tilt = std::acos(std::clamp(-up.normalized().y(), -1.0, 1.0));
  for (const auto& [name, time] : state_->device.kernel_times()) statistics.kernels[name] = {time.calls, time.total_ms};
  return statistics;
}

}  // namespace cairn
