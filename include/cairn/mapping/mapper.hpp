// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/map.hpp"
#include "cairn/mapping/options.hpp"
#include "cairn/mapping/reports.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

struct MapState;
class MapperAccess;

enum class Poses {
  tracked,  ///< estimated by aligning each frame with the map, in the first camera's frame; exports are
            ///< gravity-aligned, see Mapper::upright
  given     ///< given by Frame::world_from_camera
};

/// Optional stages of Mapper::finish, in their order.
struct FinishOptions {
  bool refine = false;  ///< Mapper::refine
  bool adjust = false;  ///< Mapper::adjust
  /// Mapper::reintegrate after Mapper::adjust, with the adjusted depth correction and a confirmed readout: the same
  /// recording from its start, with the same frames held out. Null: the submaps are deformed.
  Source* reintegrate = nullptr;
  /// Keeps the result of the stages only if held-out frames confirm it (Frame::held_out). With fewer than four of them
  /// the result is kept.
  bool is_judged = false;
  /// Fuses the held-out frames of a re-integration, after all others.
  bool fuses_held_out = false;
  /// Re-integration: maximum number of frames between two tracked frames. At small view changes their poses are
  /// interpolated and every second of them is fused, which takes two thirds of the time.
  int max_interpolated = 0;
  /// Called with the completed fraction of a stage, 0 while unknown. Returns false to end the stage as its own function
  /// does, and to skip the following stages.
  std::function<bool(FinishStage stage, double fraction)> progress;
};

/// Options for a quality. `again`: see FinishOptions::reintegrate; null: the map is only deformed.
[[nodiscard]] FinishOptions finish_options(Quality quality, Source* again);

/// Builds a map from a stream of frames. Start here.
///
///   auto source = cairn::open_source("rgbd_dataset_freiburg1_desk");
///   cairn::Mapper mapper(source->rig());
///   while (auto frame = source->next()) mapper.add(*frame);
///   mapper.finish();
///   mapper.map().export_mesh("desk.glb");
///
/// Output is available from its Map; a Session stores it so that another program can continue; a LiveSurface displays
/// it while it grows. Not thread-safe: use from one thread at a time.
class Mapper {
 public:
  /// Keeps all data in memory, unless it is created by a Session. `device`: index of list_devices; -1 chooses. Throws
  /// std::runtime_error for cameras or options out of range (see check), and for an unusable device.
  explicit Mapper(const Rig& rig, const Options& options = {}, Poses poses = Poses::tracked, int device = -1);

  /// Tracks and fuses the next frame; for a held-out frame only the pose is stored (Frame::held_out). The report states
  /// bad frames and lost tracking. Throws std::runtime_error only if the device fails or its memory cannot hold one
  /// view; the map so far remains readable and writable.
  FrameReport add(const Frame& frame);
  /// Starts another recording, at any place inside or outside the map. Its frames are lost until relocalized; after a
  /// while without relocalization they start a new component.
  void begin_recording();

  /// Finishes the map after the last frame: runs the requested stages, applies all pending loop closures and freezes
  /// the gravity direction. The functions below are its steps. A failed stage leaves the map as before, with a warning.
  FinishReport finish(const FinishOptions& options = {});
  /// Applies all pending loop closures to the keyframe poses, as functions of map() do. Call it before trajectory() if
  /// no frame follows.
  void finish_optimization();
  /// Aligns covisible keyframes with each other and corrects the poses; the map follows by moving the submaps.
  /// `progress` receives the completed fraction and returns false to cancel. If canceled or failed, the poses stay
  /// unchanged and a warning gives the reason.
  RefineReport refine(const std::function<bool(double)>& progress = {});
  /// Bundle adjustment (after Schöps, Sattler & Pollefeys 2019): optimizes all keyframe poses jointly for depth and
  /// brightness consistency, with the color camera's clock, the readout time of the shutters and the depth correction;
  /// the map follows by moving the submaps. Close all loops before. `progress` receives the completed fraction and
  /// returns false to stop early; the result so far is kept. If it fails, the poses stay unchanged and a warning gives
  /// the reason.
  AdjustReport adjust(const std::function<bool(double)>& progress = {});
  /// Re-integrates all frames instead of deforming submaps (as BundleFusion: Dai et al. 2017): keyframes at their
  /// current poses, then the frames between them, each tracked again against the new volume. From here on `correction`
  /// is applied to depth in addition to the rig's, see Adjusted. `source` is the same recording from its start, with
  /// the same frames held out. `progress` is called at each keyframe and each frame with the number of frames so far
  /// and returns false to cancel. If canceled or failed, the map stays unchanged and a warning gives the reason.
  void reintegrate(Source& source, const DepthCorrection& correction = {},
                   const std::function<bool(int)>& progress = {});

  /// The given rig, including depth corrections and a readout added since.
  [[nodiscard]] const Rig& rig() const;
  /// Gravity alignment of the map: rotation applied to all output of map() and trajectory(); gravity is +y if known.
  /// Cheap enough for a call per second.
  [[nodiscard]] GravityAlignment upright() const;
  /// Freezes the gravity direction, in this program and in the session. Later recordings do not change it. Call it when
  /// the map's files are written. Further frames of the first recording still refine it, so that a resumed run ends the
  /// same as an uninterrupted run. Also calls finish_optimization().
  void freeze_gravity();
  /// A view of the current map; each call reads the latest state.
  [[nodiscard]] Map map();
  /// With EsdfOptions::live: distance field as of the last frame, in the tracking frame (the world frame before loop
  /// corrections). Null before the first frame, and after a failure. Safe to call from any thread while another thread
  /// adds frames.
  [[nodiscard]] std::shared_ptr<const DistanceField> live_distances() const;

  /// Poses of all fused or held-out frames, in the gravity-aligned world and the color camera's clock: with
  /// Poses::tracked, depth timestamps are shifted by the estimated clock offset (Statistics::clock_offset). Omits
  /// frames of components not connected to the largest one. `recording`: counted from 0 in a resumed session; -1: the
  /// last.
  [[nodiscard]] Trajectory trajectory(int recording = -1) const;
  [[nodiscard]] int recordings() const;
  /// Trajectory of the last recording for display, in the tracking frame: at most `points` of its poses, at least two,
  /// including the first and the newest.
  [[nodiscard]] Trajectory path(std::size_t points) const;
  [[nodiscard]] std::vector<KeyframeInfo> keyframes() const;
  /// Loop closures found while adding frames, in order.
  [[nodiscard]] std::vector<FoundLoop> loops() const;
  [[nodiscard]] Statistics statistics() const;
  /// Optional stages switched off after a failure, one line each, in order of occurrence.
  [[nodiscard]] const std::vector<std::string>& warnings() const;

  Mapper(Mapper&&) noexcept = default;
  Mapper& operator=(Mapper&&) noexcept = default;

 private:
  friend class MapperAccess;
  explicit Mapper(std::shared_ptr<MapState> state);

  std::shared_ptr<MapState> state_;
};

}  // namespace cairn
