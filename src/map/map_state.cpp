// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/map_state.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <string_view>
#include <utility>

#include "map/tracking_criteria.hpp"

namespace cairn {
namespace {

constexpr int kMaxRepeats = 2;
constexpr std::uint32_t kColourEvery = 3;  // fused frames, for a slowly moving view
constexpr double kFastView = 0.1;          // share of the image, from frame to frame
constexpr double kUnseen = 0.1;  // share of the image by which the view moves between two frames that carve free space
constexpr double kShutterPixels = 4.0;                          // max. row error without preprocessing again
constexpr std::uint64_t kWorldPool = std::uint64_t{256} << 20;  // bytes on the device while the whole map is meshed

Trajectory turned(Trajectory trajectory, const Eigen::Isometry3d& turn) {
  if (turn.matrix().isIdentity(0)) return trajectory;
  for (StampedPose& pose : trajectory) {
    pose.world_from_camera = turn * pose.world_from_camera;
    pose.world_from_camera.linear() =
        Eigen::Quaterniond(pose.world_from_camera.linear()).normalized().toRotationMatrix();
  }
  return trajectory;
}

}  // namespace

MapState::MapState(const Rig& r, const Options& o, Poses p, int device_index, MapFiles f)
    : options(o),
      rig(r),
      files(std::move(f)),
      device(device_index),
      preprocessor(device, r, o.surface, o.track.levels, o.track.finest_level),
      integrator(device, preprocessor.camera(), o.surface, r.sensor, free_radius(o.fuse, o.esdf)),
      polygonizer(device),
      volume(device, o.fuse, o.surface.max_depth),
      back_end(device, r, o, files.folder, files.access, files.parts),
      tracker(device, r, preprocessor.camera(), o, back_end.keyframes(), back_end.images()),
      given{.poses = {}, .images = {r, {}}, .keyframes = {}, .views = {}},
      poses(p) {}

CheckedFrame MapState::check(const Frame& frame) {
  CheckedFrame checked(frame, rig, last_fused);
  if (!is_tracked())
    checked.expect_pose(options.fuse.voxel_size);
  else if (checked.is_usable() && !frame.held_out && is_stuck(frame))
    checked.refuse(FrameCause::stuck);
  return checked;
}

/// Sensor noise never repeats exactly. A driver may deliver an image twice, but not more often.
bool MapState::is_stuck(const Frame& frame) {
  const std::size_t image = std::hash<std::string_view>()(
      {reinterpret_cast<const char*>(frame.depth.data()), frame.depth.size() * sizeof(float)});
  repeats = image == last_image ? repeats + 1 : 0;
  last_image = image;
  return repeats > kMaxRepeats;
}

Surface MapState::see(const Frame& frame, const MotionAt& motion, StageTimes& times) {
  return timed(times, "preprocess", [&] { return preprocessor.preprocess(frame, motion); });
}

/// The rolling shutter correction uses a predicted motion. Alignment accounts for a different motion, and the frame is
/// preprocessed again before fusion if the difference is significant.
Tracked MapState::locate(const Frame& frame, Surface& seen, StageTimes& times) {
  if (!is_tracked()) {
    Vector6d velocity = Vector6d::Zero();
    if (is_rolling(rig) && !given.poses.empty())
      velocity = local_coordinates(given.poses.back().world_from_camera.inverse() * *frame.world_from_camera) /
                 (frame.timestamp - given.poses.back().timestamp);
    seen = see(frame, at_velocity(velocity), times);
    return {.state = Tracked::State::begins, .submap_from_camera = *frame.world_from_camera};
  }
  const MotionAt guessed = tracker.motion(frame);
  seen = see(frame, guessed, times);
  if (frame.held_out) return tracker.look(frame, seen, volume, times);
  Tracked tracked = tracker.track(frame, seen, volume, times);
  if (!is_rolling(rig) || tracked.state != Tracked::State::aligned) return tracked;
  const MotionAt found = tracker.motion(frame, tracked.submap_from_camera);
  if (shutter_difference(rig, guessed, found) < kShutterPixels) return tracked;
  seen = see(frame, found, times);
  tracker.leave_out_moving(seen, tracked, volume);
  return tracked;
}

/// Fuses color of every third frame, since many frames see the same place, and of every frame while the view moves
/// fast.
bool MapState::is_colour_due(const Tracked& tracked) const {
  if (fused_count % kColourEvery == 0) return true;  // true for the first frame, and for every third one after it
  const auto moved = motion(tracked);
  return !moved || view_change(rig.depth, *moved) > kFastView;
}

std::uint32_t MapState::look_every(const std::optional<Eigen::Isometry3d>& motion) const {
  if (!motion) return 1;
  const double frames = kUnseen / std::max(view_change(rig.depth, *motion), 1e-9);
  return static_cast<std::uint32_t>(std::clamp(frames, 1.0, static_cast<double>(Integrator::kLookEvery)));
}

std::optional<Eigen::Isometry3d> MapState::motion(const Tracked& tracked) const {
  const auto& last = tracker.memory().last;
  if (is_tracked() ? last.empty() : given.poses.empty()) return std::nullopt;
  const Eigen::Isometry3d& before =
      is_tracked() ? last.back().submap_from_camera : given.poses.back().world_from_camera;
  return before.inverse() * tracked.submap_from_camera;
}

/// The next frame is unrelated to the active submap.
void MapState::begin_component() {
  back_end.end_submap(volume, fused_count, false);
  esdf.reset();
  for (GrowingSurface& surface : surfaces) surface = {};
}

/// Commits a fused frame: to the tracker, and to the back end as a possible keyframe.
void MapState::remember(const Frame& frame, const Surface& live, const Tracked& tracked, StageTimes& times) {
  const Eigen::Isometry3d& pose = tracked.submap_from_camera;
  if (is_tracked()) {
    tracker.commit(frame, live, tracked);
    const bool is_keyframe = timed(
        times, "keyframe", [&] { return back_end.add(frame, live, pose, tracked.information(), volume, fused_count); });
    if (is_keyframe) warnings().attempt("the focal length is not checked", [&] { tracker.learn_focal_length(); });
  } else {
    keep_given_keyframe(frame, live);
    note_given_view(frame, live);
    given.poses.push_back({frame.timestamp, pose});
  }
  last_fused = frame.timestamp;
  whole.reset();
}

/// The map does not change. Fails if there is no map around the frame yet.
void MapState::hold_out(const Frame& frame, const Tracked& tracked, FrameReport& report) {
  if (!is_tracked()) {
    given.poses.push_back({frame.timestamp, tracked.submap_from_camera});
  } else if (!back_end.hold_out(frame.timestamp, tracked.submap_from_camera)) {
    report.state = FrameState::lost;
    report.cause = FrameCause::not_relocalised;
    report.reason = "held out before the map goes on";
    return;
  }
  report.state = FrameState::held_out;
  last_fused = frame.timestamp;
}

/// With given poses, keyframes serve only for textures.
void MapState::keep_given_keyframe(const Frame& frame, const Surface& live) {
  if (!options.keep_keyframes) return;
  if (!given.keyframes.empty() &&
      !is_apart(given.poses[given.keyframes.back().first].world_from_camera, *frame.world_from_camera))
    return;
  given.images.put(given.keyframes.size(), live.images(), {});
  given.keyframes.emplace_back(given.poses.size(), frame.colour_delay);
}

/// Collects evidence for the gravity direction of the given poses' world.
void MapState::note_given_view(const Frame& frame, const Surface& live) {
  const Eigen::Isometry3d& pose = *frame.world_from_camera;
  if (frame.acceleration)
    given.accelerations +=
        (Eigen::Vector4d() << pose.linear() * *frame.acceleration, frame.acceleration->norm()).finished();
  if (given.views.empty() || is_apart(given.poses[given.views.back().first].world_from_camera, pose))
    given.views.emplace_back(given.poses.size(), back_end.structure(live.images()));
}

/// Updates the distance field and the live surfaces with the bricks changed by a frame.
void MapState::follow(const Fused& fused, StageTimes& times) {
  if (options.esdf.live) follow_distances(fused, times);
  for (GrowingSurface& surface : surfaces) surface.change(fused.changed);
}

/// A new field starts with all bricks of the volume. After an error the field is removed: a stale one would report
/// occupied space as free.
void MapState::follow_distances(const Fused& fused, StageTimes& times) {
  options.esdf.live = warnings().attempt("there is no distance field from here on", [&] {
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

void MapState::end_everything() {
  back_end.settle();
  back_end.end_submap(volume, fused_count, false);
  whole.reset();
}

FuseOptions MapState::world_pool() const {
  FuseOptions pool = options.fuse;
  pool.device_memory = std::min(pool.device_memory != 0 ? pool.device_memory : kWorldPool, kWorldPool);
  return pool;
}

Volume& MapState::world() {
  if (!is_tracked()) return volume;
  back_end.settle();
  if (back_end.is_plain()) return volume;
  if (!whole) {
    back_end.end_submap(volume, fused_count, true);
    whole.emplace(device, world_pool(), options.surface.max_depth);
    whole->adopt(back_end.world().release());
  }
  return *whole;
}

int MapState::recordings() const { return 1 + static_cast<int>(back_end.atlas().recordings.size()); }

Upright MapState::upright() const {
  if (is_tracked()) return back_end.atlas().upright();
  DownEvidence evidence{.accelerations = given.accelerations};
  if (!given.poses.empty()) evidence.world_from_first_camera = given.poses.front().world_from_camera.linear();
  for (const auto& [pose, structure] : given.views)
    evidence.views.push_back({given.poses[pose].world_from_camera.linear(), &structure});
  if (!options.up) return upright_as_given(evidence);
  const auto down = find_down(evidence, *options.up);
  return down ? upright_by(*down, evidence) : upright_unknown();
}

Trajectory MapState::trajectory(int recording) const {
  const Eigen::Isometry3d turn(upright().world_from_tracked);
  if (!is_tracked()) return turned(given.poses, turn);
  const Atlas& atlas = back_end.atlas();
  const auto number = static_cast<std::size_t>(recording < 0 ? recordings() - 1 : recording);
  const std::size_t begin = number == 0 ? 0 : atlas.recordings.at(number - 1);
  const std::size_t end = number < atlas.recordings.size() ? atlas.recordings[number] : atlas.frames.size();
  Trajectory trajectory = atlas.trajectory(atlas.main_component(), begin, end);
  for (StampedPose& pose : trajectory) pose.timestamp += tracker.clock_offset();
  return turned(std::move(trajectory), turn);
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
                        .looked_up = back_end.counts().looked_up,
                        .loops_tried = back_end.counts().tried,
                        .graph_ms = back_end.counts().graph_ms,
                        .world_ms = back_end.counts().world_ms,
                        .submap_memory_peak = back_end.submaps().counts().peak_bytes,
                        .submaps_read_back = back_end.submaps().counts().read_back,
                        .clock_offset = tracker.clock_offset(),
                        .focal = tracker.focal(),
                        .kernels = {},
                        .sigma_median = back_end.atlas().surface_sigma.quantile(0.5),
                        .sigma_95 = back_end.atlas().surface_sigma.quantile(0.95)};
  for (const auto& [name, time] : device.kernel_times()) statistics.kernels[name] = {time.calls, time.total_ms};
  return statistics;
}

}  // namespace cairn
