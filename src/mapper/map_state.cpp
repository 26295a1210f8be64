// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/map_state.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "mapper/tracking_criteria.hpp"

namespace cairn {
namespace {

constexpr std::uint32_t kColorInterval = 3;  // fused frames, for a slowly moving view
constexpr double kFastView = 0.1;            // share of the image, from frame to frame
// Share of the image by which the view moves between two frames that carve free space.
constexpr double kMinCarvingChange = 0.1;
// Bytes on the device while the whole map is meshed.
constexpr std::uint64_t kGlobalVolumeMemory = std::uint64_t{256} << 20;

Trajectory rotated(Trajectory trajectory, const Eigen::Isometry3d& rotation) {
  if (rotation.matrix().isIdentity(0)) return trajectory;
  for (StampedPose& pose : trajectory) {
    pose.world_from_camera = rotation * pose.world_from_camera;
    pose.world_from_camera.linear() =
        Eigen::Quaterniond(pose.world_from_camera.linear()).normalized().toRotationMatrix();
  }
  return trajectory;
}

}  // namespace

MapState::MapState(const Rig& r, const Options& o, Poses kind, int device_index, MapFiles f)
    : options(o),
      rig(r),
      files(std::move(f)),
      device(device_index),
      preprocessor(std::in_place, device, r, o.surface, o.track.levels, o.track.finest_level),
      integrator(device, preprocessor->camera(), o.surface, r.sensor, free_radius(o.fuse, o.esdf)),
      polygonizer(device),
      volume(device, o.fuse, o.surface.max_depth),
      back_end(device, r, o, files.folder, files.access, files.source_maps),
      tracker(device, r, preprocessor->camera(), o, back_end.keyframes(), back_end.images()),
      held_out(r),
      poses(kind == Poses::tracked
                ? PoseSource(std::in_place_type<TrackedPoses>, rig, *preprocessor, volume, back_end, tracker, repeats)
                : PoseSource(std::in_place_type<GivenPoses>, rig, options, *preprocessor, back_end)) {}

CheckedFrame MapState::check(const Frame& frame) {
  CheckedFrame checked(frame, rig, last_fused);
  std::visit([&](auto& source) { source.check(frame, checked); }, poses);
  return checked;
}

TrackingResult MapState::track(const Frame& frame, FramePyramid& seen, StageTimes& times) {
  return std::visit([&](auto& source) { return source.track(frame, seen, times); }, poses);
}

/// Fuses color of every third frame, since many frames see the same place, and of every frame while the view moves
/// fast.
bool MapState::is_color_due(const TrackingResult& tracked) const {
  if (fused_count % kColorInterval == 0) return true;  // true for the first frame, and for every third one after it
  const auto moved = motion(tracked);
  return !moved || view_change(rig.depth, *moved) > kFastView;
}

std::uint32_t MapState::carving_interval(const std::optional<Eigen::Isometry3d>& motion) const {
  if (!motion) return 1;
  const double frames = kMinCarvingChange / std::max(view_change(rig.depth, *motion), 1e-9);
  return static_cast<std::uint32_t>(std::clamp(frames, 1.0, static_cast<double>(Integrator::kCarvingInterval)));
}

std::optional<Eigen::Isometry3d> MapState::motion(const TrackingResult& tracked) const {
  const auto last = std::visit([](const auto& source) { return source.last(); }, poses);
  if (!last) return std::nullopt;
  return last->inverse() * tracked.submap_from_camera;
}

/// The next frame is unrelated to the active submap.
void MapState::begin_component() {
  back_end.end_submap(volume, fused_count, false);
  esdf.reset();
  for (IncrementalMesher& surface : surfaces) surface = {};
}

void MapState::commit_frame(const Frame& frame, const FramePyramid& live, const TrackingResult& tracked,
                            StageTimes& times) {
  std::visit([&](auto& source) { source.commit(frame, live, tracked, fused_count, times); }, poses);
  last_fused = frame.timestamp;
  cached_volume.reset();
}

/// The map does not change. Fails if there is no map around the frame yet.
void MapState::hold_out(const Frame& frame, const FramePyramid& seen, const TrackingResult& tracked,
                        FrameReport& report) {
  if (!std::visit([&](auto& source) { return source.hold_out(frame, tracked); }, poses)) {
    report.state = FrameState::lost;
    report.cause = FrameCause::not_relocalized;
    report.reason = "held-out frame before the map continues";
    return;
  }
  report.state = FrameState::held_out;
  held_out.add(frame.timestamp, seen, options.surface);
  last_fused = frame.timestamp;
}

std::optional<HeldOutError> MapState::held_out_error() {
  if (held_out.empty()) return std::nullopt;
  const BrickTree& world = global_volume().on_host();
  const Atlas& atlas = back_end.atlas();
  return held_out.compare(world, options.fuse, {}, atlas.trajectory(atlas.main_component(), 0, atlas.frames.size()));
}

/// Updates the distance field and the live surfaces with the bricks changed by a frame.
void MapState::update_esdf_and_mesh(const IntegrationResult& fused, StageTimes& times) {
  if (options.esdf.live) update_esdf(fused, times);
  for (IncrementalMesher& surface : surfaces) surface.change(fused.changed);
}

/// A new field starts with all bricks of the volume. After an error the field is removed: a stale one would report
/// occupied space as free.
void MapState::update_esdf(const IntegrationResult& fused, StageTimes& times) {
  options.esdf.live = warnings().attempt("the distance field is disabled", [&] {
    timed(times, "esdf", [&] {
      std::vector<Brick> changed = fused.changed;
      changed.insert(changed.end(), fused.newly_free.begin(), fused.newly_free.end());
      if (!esdf) {
        esdf.emplace(device, options.fuse, options.esdf);
        changed = volume.bricks();
        const std::vector<Brick> free = volume.host().free_bricks();
        changed.insert(changed.end(), free.begin(), free.end());
      }
      return esdf->update(volume, changed);
    });
    live_distances.put(timed(times, "esdf to host", [&] { return esdf->field(); }));
  });
  if (options.esdf.live) return;
  esdf.reset();
  live_distances.put({});
}

void MapState::set_rig(const Rig& calibrated) {
  const bool has_new_shutter = !calibrated.has_same_cameras(rig);
  rig = calibrated;
  if (has_new_shutter)
    preprocessor.emplace(device, rig, options.surface, options.track.levels, options.track.finest_level);
}

void MapState::end_map() {
  back_end.finish_optimization();
  back_end.end_submap(volume, fused_count, false);
  cached_volume.reset();
}

FuseOptions MapState::global_volume_options() const {
  FuseOptions pool = options.fuse;
  pool.device_memory =
      std::min(pool.device_memory != 0 ? pool.device_memory : kGlobalVolumeMemory, kGlobalVolumeMemory);
  return pool;
}

Volume& MapState::global_volume() {
  back_end.finish_optimization();
  if (back_end.is_undeformed()) return volume;
  if (!cached_volume) {
    back_end.end_submap(volume, fused_count, true);
    cached_volume.emplace(device, global_volume_options(), options.surface.max_depth);
    cached_volume->adopt(back_end.global_volume().release());
  }
  return *cached_volume;
}

int MapState::recordings() const { return 1 + static_cast<int>(back_end.atlas().recordings.size()); }

GravityAlignment MapState::upright() const {
  return std::visit([](const auto& source) { return source.upright(); }, poses);
}

Trajectory MapState::trajectory(int recording) const {
  return rotated(std::visit([&](const auto& source) { return source.trajectory(recording); }, poses),
                 Eigen::Isometry3d(upright().world_from_tracked));
}

Trajectory MapState::path(std::size_t points) const {
  return std::visit([&](const auto& source) { return source.path(points); }, poses);
}

const KeyframeStore& MapState::images() const {
  return std::visit([](const auto& source) -> const KeyframeStore& { return source.images(); }, poses);
}

Statistics MapState::statistics() const {
  const auto& counts = volume.counts();
  const auto component_of = back_end.atlas().components();
  Statistics statistics{.device = device.info().name,
                        .device_memory_peak = device.peak_memory(),
                        .device_waits = device.traffic().waits,
                        .uploaded = device.traffic().uploaded,
                        .downloaded = device.traffic().downloaded,
                        .bricks = counts.allocated,
                        .paged_out = counts.paged_out,
                        .paged_in = counts.paged_in,
                        .keyframes = static_cast<int>(back_end.atlas().keyframes.size()),
                        .submaps = static_cast<int>(back_end.submaps().size()),
                        .components = static_cast<int>(std::set(component_of.begin(), component_of.end()).size()),
                        .database_queries = back_end.counts().database_queries,
                        .loops_tried = back_end.counts().tried,
                        .graph_ms = back_end.counts().graph_ms,
                        .world_ms = back_end.counts().world_ms,
                        .submap_memory_peak = back_end.submaps().counts().peak_bytes,
                        .submaps_read_back = back_end.submaps().counts().read_back,
                        .clock_offset = tracker.clock_offset(),
                        .focal = tracker.focal(),
                        .inertial = tracker.inertial().report(),
                        .kernels = {},
                        .sigma_median = back_end.atlas().surface_sigma.quantile(0.5),
                        .sigma_95 = back_end.atlas().surface_sigma.quantile(0.95)};
  for (const auto& [name, time] : device.kernel_times())
    statistics.kernels[name] = {.calls = time.calls, .milliseconds = time.total_ms};
  return statistics;
}

}  // namespace cairn
