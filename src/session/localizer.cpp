// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/localizer.hpp"

#include <chrono>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/path_kind.hpp"
#include "export/change.hpp"
#include "geometry/readout.hpp"
#include "mapper/frame_report.hpp"
#include "mapper/map_state.hpp"
#include "session/open_session.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Meters from the camera position of the last paging; the pool holds the map several meters around it.
constexpr double kPagingDistance = 0.5;
// Minimum requirements for a written pose: share of inliers, share of the frame's points that see the map, misfit.
constexpr double kMinInlierShare = 0.4, kMinOverlap = 0.25, kMaxWrittenMisfit = 6.0;
constexpr std::uint32_t kColorInterval = 3;  // frames of LocalizerOptions::changes fused without and with color
constexpr int kMaxUnconfirmed = 15;          // consecutive frames of tracking without a confirmed pose

/// Folder of a map's session.
fs::path session_of(const fs::path& map) {
  if (fs::exists(map / "session" / "state.cbor")) return map / "session";
  if (fs::exists(map / "state.cbor")) return map;
  if (fs::exists(map / "map.vdb") || fs::exists(map / "session"))
    throw std::runtime_error(map.string() +
                             ": has no session, which stores the keyframes of the map: make it with "
                             "cairn reconstruct, without --poses, and wait for its first checkpoint");
  throw std::runtime_error(kind_of_path(map).mismatch(map, "map with a session"));
}

/// Loads the main component as one volume in the world frame, ready for frames at any place.
std::shared_ptr<MapState> load_map(const fs::path& folder, int device) {
  auto map = open_session(session_of(folder), device);
  if (map->back_end.atlas().keyframes.empty())
    throw std::runtime_error(folder.string() + ": its session has no keyframe: finish the run with --resume");
  return map;
}

/// Voxels of the main component in the world frame. Its free space, which takes as long, serves changes alone.
BrickTree world_of(MapState& map, bool with_free_space) {
  BackEnd& back_end = map.back_end;
  const LoadFree none = [](std::size_t) { return std::make_shared<const BrickTree>(); };
  GlobalVolume world(map.device, map.options.fuse);
  (void)world.update(back_end.placed_submaps(), back_end.load_submap(), with_free_space ? back_end.load_free() : none);
  return world.release();
}

/// True if the images of two rigs have the same views, apart from a rolling shutter, which stored keyframes lack.
bool has_same_images(const Rig& a, const Rig& b) {
  const Rig first = with_global_shutter(a), second = with_global_shutter(b);
  return first.depth == second.depth && first.color == second.color;
}

/// Rig of the frames, with the calibration found for the map if the cameras are the same.
Rig calibrated(Rig rig, const Rig& map) {
  if (!has_same_images(rig, map)) return rig;
  if (!is_rolling(rig)) rig = with_readout(std::move(rig), map.depth.readout);
  if (rig.depth_correction.empty()) rig.depth_correction = map.depth_correction;
  return rig;
}

/// Options of the map, with those of the localizer. A lost frame never starts a component.
Options tracking_options(const MapState& map, const LocalizerOptions& options) {
  Options all = map.options;
  all.track = options.track;
  all.motion = options.motion;
  check(all);
  all.map.lost_frames = std::numeric_limits<int>::max();
  return all;
}

/// True if the map's surface confirms the pose: neither a prediction alone, nor a view mostly outside the map.
bool is_confirmed(const TrackingResult& tracked) {
  const AlignmentFit& fit = tracked.alignment.fit;
  return tracked.state == TrackingResult::State::aligned && tracked.guess != InitialGuess::gyroscope &&
         tracked.guess != InitialGuess::device && fit.unobserved == 0 && fit.inlier_share > kMinInlierShare &&
         fit.overlap > kMinOverlap && misfit(tracked.alignment) < kMaxWrittenMisfit;
}

/// Surface of the localized frames, in the tracking frame of the map.
struct SeenSurface {
  SeenSurface(MapState& map, const Camera& camera, const SensorModel& sensor)
      : integrator(map.device, camera, map.options.surface, sensor),
        volume(map.device, map.global_volume_options(), map.options.surface.max_depth) {}
  Integrator integrator;
  Volume volume;
  std::uint32_t frames = 0;
};

}  // namespace

struct Localizer::State {
  State(const fs::path& folder, const Rig& r, const LocalizerOptions& o, int device)
      : map(load_map(folder, device)),
        rig(calibrated(r, map->rig)),
        options(tracking_options(*map, o)),
        preprocessor(map->device, rig, options.surface, options.track.levels, options.track.finest_level),
        tracker(map->device, rig, preprocessor.camera(), options, map->back_end.keyframes(), map->back_end.images()) {
    map->back_end.finish_optimization();
    upright = map->upright();
    map->end_map();
    map->volume.adopt(world_of(*map, o.changes));
    map->back_end.begin_recording();
    tracker.start_lost();
    if (has_same_images(rig, map->rig))
      keyframe_preprocessor.emplace(map->device, with_global_shutter({map->rig.depth, map->rig.color}), options.surface,
                                    options.track.levels, options.track.finest_level);
    tracker.localize_only(keyframe_preprocessor ? &*keyframe_preprocessor : nullptr);
    if (o.changes) seen.emplace(*map, preprocessor.camera(), rig.sensor);
  }

  [[nodiscard]] CheckedFrame check(const Frame& frame) {
    CheckedFrame checked(frame, rig, last);
    if (checked.is_usable() && repeats.is_stuck(frame)) checked.reject(FrameCause::stuck);
    return checked;
  }
  TrackingResult track(const Frame& frame, LocalizedFrame& localized);
  /// Loads the map around a tracked camera; the tracker does so for a lost camera.
  void page_in(const Eigen::Vector3d& camera) {
    if (paged_at && (camera - *paged_at).norm() < kPagingDistance) return;
    map->volume.page_in_around(camera);
    paged_at = camera;
  }
  void start_lost() {
    tracker.start_lost();
    paged_at.reset();
    unconfirmed = 0;
  }

  std::shared_ptr<MapState> map;
  Rig rig;
  Options options;
  Preprocessor preprocessor;
  std::optional<Preprocessor> keyframe_preprocessor;  // with the map's cameras
  Tracker tracker;
  GravityAlignment upright;
  std::optional<SeenSurface> seen;
  std::optional<Eigen::Vector3d> paged_at;  // meters, tracking frame
  std::optional<double> last;               // timestamp of the last tracked frame
  RepeatedImages repeats;
  int unconfirmed = 0;  // consecutive tracked frames without a confirmed pose
};

TrackingResult Localizer::State::track(const Frame& frame, LocalizedFrame& localized) {
  FramePyramid live = preprocessor.preprocess(frame, tracker.motion(frame));
  StageTimes times;
  TrackingResult tracked = tracker.track(frame, live, map->volume, times);
  localized.guess = tracked.guess;
  localized.fit = tracked.alignment.fit;
  localized.cause = tracked.cause;
  localized.reason = tracked.reason;
  if (tracked.state != TrackingResult::State::aligned) {
    paged_at.reset();
    return tracked;
  }
  tracker.commit(frame, live, tracked);
  last = frame.timestamp;
  page_in(tracked.submap_from_camera.translation());
  if (seen && is_confirmed(tracked)) {
    if (seen->frames % kColorInterval == 0) live.register_color_to_depth();
    (void)seen->integrator.integrate(live, tracked.submap_from_camera, seen->volume, ++seen->frames);
  }
  return tracked;
}

Localizer::Localizer(const fs::path& map, const Rig& rig, const LocalizerOptions& options, int device) {
  check(rig);
  state_ = std::make_unique<State>(map, rig, options, device);
}
Localizer::~Localizer() = default;
Localizer::Localizer(Localizer&&) noexcept = default;
Localizer& Localizer::operator=(Localizer&&) noexcept = default;

LocalizedFrame Localizer::add(const Frame& frame) {
  const auto start = std::chrono::steady_clock::now();
  State& s = *state_;
  LocalizedFrame localized{.index = frame.index, .timestamp = frame.timestamp};
  const CheckedFrame checked = s.check(frame);
  s.tracker.add_inertial(checked.frame());
  if (checked.is_usable()) {
    const TrackingResult tracked = s.track(checked.frame(), localized);
    if (is_confirmed(tracked)) {
      s.unconfirmed = 0;
      localized.world_from_camera = Eigen::Isometry3d(s.upright.world_from_tracked) * tracked.submap_from_camera;
      localized.covariance = covariance_of(tracked);
    } else {
      if (localized.cause == FrameCause::none) localized.cause = FrameCause::poor_fit;
      if (localized.reason.empty()) localized.reason = to_string(localized.cause);
      if (tracked.state == TrackingResult::State::aligned && ++s.unconfirmed > kMaxUnconfirmed) s.start_lost();
    }
  } else {
    localized.cause = checked.cause();
    localized.reason = checked.reason();
  }
  localized.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return localized;
}

void Localizer::begin_recording() {
  state_->start_lost();
  state_->last.reset();
  state_->repeats = {};
}

ExportedChange Localizer::export_changes(const fs::path& file, const ChangeOptions& options,
                                         const ExportProgress& progress) {
  State& s = *state_;
  if (!s.seen) throw std::runtime_error("Localizer::export_changes: needs LocalizerOptions::changes");
  if (s.seen->frames == 0) throw std::runtime_error(file.string() + ": cannot be written: no frame was localized");
  const auto chunks_of = [&](Volume& volume) {
    return MapChunks{.bricks = volume.bricks(),
                     .volume = volume,
                     .load = {},
                     .polygonizer = s.map->polygonizer,
                     .free = volume.on_host(),
                     .upright = s.upright};
  };
  const MapChunks before = chunks_of(s.map->volume), after = chunks_of(s.seen->volume);
  return write_change({"the map", before}, {"the recording", after}, file, options, progress);
}

const GravityAlignment& Localizer::upright() const { return state_->upright; }

const std::vector<std::string>& Localizer::warnings() const { return state_->map->back_end.warnings().all(); }

}  // namespace cairn
