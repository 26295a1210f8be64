// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapper.hpp"

#include <chrono>
#include <cmath>

#include "surface/preprocess.hpp"
#include "track/icp.hpp"
#include "volume/integrate.hpp"
#include "volume/polygonize.hpp"
#include "volume/raycast.hpp"

namespace cairn {
namespace {

/// Runs a stage and notes its time.
template <class Stage>
auto timed(FrameReport& report, const char* name, Stage&& stage) {
  const auto start = std::chrono::steady_clock::now();
  auto result = stage();
  report.stage_ms[name] += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return result;
}

std::string unusable(const Frame& frame, const Camera& camera, const Trajectory& before) {
  const auto pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  if (!frame.problem.empty()) return frame.problem;
  if (frame.depth.size() != pixels) return "the depth image is not of the camera's size";
  if (!frame.colour.empty() && frame.colour.size() != pixels) return "the colour image is not of the camera's size";
  if (!std::isfinite(frame.timestamp)) return "the timestamp is not a number";
  if (!before.empty() && frame.timestamp <= before.back().timestamp) return "the timestamp goes back";
  return {};
}

}  // namespace

struct Mapper::State {
  State(const Camera& c, const Options& o, Poses p, int device_index)
      : options(o),
        poses(p),
        camera(c),
        device(device_index),
        preprocess(device, c, o.surface, o.track.levels, o.track.finest_level),
        raycast(device, preprocess.camera(), o.surface, o.track.levels, o.track.finest_level),
        icp(device, o.track),
        integrate(device, preprocess.camera(), o.surface),
        polygonize(device),
        volume(device, o.fuse, o.surface.max_depth) {}

  /// Where the camera would be if it kept its velocity since the last two fused frames.
  [[nodiscard]] Eigen::Isometry3d predict(double timestamp) const {
    const Eigen::Isometry3d& last = trajectory.back().world_from_camera;
    if (frames_lost > 0 || trajectory.size() < 2) return last;
    const StampedPose& before = trajectory[trajectory.size() - 2];
    const double interval = trajectory.back().timestamp - before.timestamp;
    const double ratio = std::min((timestamp - trajectory.back().timestamp) / interval, 2.0);
    const Eigen::Isometry3d motion = before.world_from_camera.inverse() * last;
    const Eigen::AngleAxisd turn(motion.linear());
    Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
    step.linear() = Eigen::AngleAxisd(turn.angle() * ratio, turn.axis()).toRotationMatrix();
    step.translation() = motion.translation() * ratio;
    return last * step;
  }

  Alignment align(const Surface& live, const Eigen::Isometry3d& guess, FrameReport& report) {
    const ModelView model = timed(report, "raycast", [&] { return raycast(volume, guess); });
    return timed(report, "track", [&] { return icp(live, model, guess); });
  }

  Options options;
  Poses poses;
  Camera camera;
  gpu::Device device;
  Preprocess preprocess;
  Raycast raycast;
  Icp icp;
  Integrate integrate;
  Polygonize polygonize;
  Volume volume;
  Trajectory trajectory;
  int frames_lost = 0;      // since the last fused one
  std::uint32_t stamp = 0;  // fused frames
};

Mapper::Mapper(const Camera& camera, const Options& options, Poses poses, int device) {
  check(options);
  state_ = std::make_unique<State>(camera, options, poses, device);
}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;

FrameReport Mapper::add(const Frame& frame) {
  State& s = *state_;
  FrameReport report{
      .index = frame.index, .timestamp = frame.timestamp, .reason = unusable(frame, s.camera, s.trajectory)};
  if (!report.reason.empty()) return report;

  const Surface live = timed(report, "preprocess", [&] { return s.preprocess(frame); });

  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  if (s.poses == Poses::given) {
    if (!frame.world_from_camera) {
      report.reason = "no pose is given for this time";
      return report;
    }
    world_from_camera = *frame.world_from_camera;
  } else if (!s.trajectory.empty()) {
    Alignment alignment = s.align(live, s.predict(frame.timestamp), report);
    if (!alignment.converged() && s.frames_lost == 0)  // the hand may have stopped
      alignment = s.align(live, s.trajectory.back().world_from_camera, report);
    report.inlier_share = alignment.inlier_share;
    report.overlap = alignment.overlap;
    report.rmse = alignment.rmse;
    report.iterations = alignment.iterations;
    if (!alignment.converged()) {
      ++s.frames_lost;
      report.state = FrameState::lost;
      report.reason = alignment.lost;
      return report;
    }
    world_from_camera = alignment.submap_from_camera;
  }

  const Fused fused = timed(report, "fuse", [&] { return s.integrate(live, world_from_camera, s.volume, ++s.stamp); });
  report.touched_bricks = fused.touched;
  report.new_bricks = fused.new_bricks;
  report.state = FrameState::fused;
  s.frames_lost = 0;
  s.trajectory.push_back({frame.timestamp, world_from_camera});
  return report;
}

const Trajectory& Mapper::trajectory() const { return state_->trajectory; }

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
                        .kernels = {}};
  for (const auto& [name, time] : state_->device.kernel_times()) statistics.kernels[name] = {time.calls, time.total_ms};
  return statistics;
}

}  // namespace cairn
