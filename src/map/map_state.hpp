// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// State of a mapper: the stages, the active volume, and the back end. Mapper, Map, Session and LiveSurface are
// interfaces to it.
#pragma once
#include <filesystem>
#include <list>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/newest.hpp"
#include "base/stopwatch.hpp"
#include "cairn/mapper.hpp"
#include "map/back_end.hpp"
#include "map/checked_frame.hpp"
#include "map/growing_surface.hpp"
#include "map/tracker.hpp"
#include "surface/preprocess.hpp"
#include "surface/rectify.hpp"
#include "volume/esdf.hpp"
#include "volume/integrate.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

/// Storage of keyframes and submaps.
struct MapFiles {
  std::filesystem::path folder;  // empty: in memory
  Access access = Access::write;
  std::shared_ptr<const void> hold;  // keeps the files alive
  std::vector<PartFiles> parts;      // of other maps that this map consists of
};

struct MapState {
  MapState(const Rig& rig, const Options& options, Poses poses, int device, MapFiles files = {});

  [[nodiscard]] Warnings& warnings() { return back_end.warnings(); }
  [[nodiscard]] bool is_tracked() const { return poses == Poses::tracked; }

  // The stages of Mapper::add.
  [[nodiscard]] CheckedFrame check(const Frame& frame);
  /// `motion`: of the camera, for a rolling shutter.
  [[nodiscard]] Surface see(const Frame& frame, const MotionAt& motion, StageTimes& times);
  /// Preprocesses and tracks a frame.
  [[nodiscard]] Tracked locate(const Frame& frame, Surface& seen, StageTimes& times);
  /// True if the frame is fused with color, which requires registration to depth.
  [[nodiscard]] bool is_colour_due(const Tracked& tracked) const;
  /// Carving interval in frames, for a camera that moves like this from frame to frame.
  [[nodiscard]] std::uint32_t look_every(const std::optional<Eigen::Isometry3d>& motion) const;
  /// Relative pose from the last fused frame's camera to the current one.
  [[nodiscard]] std::optional<Eigen::Isometry3d> motion(const Tracked& tracked) const;
  void begin_component();
  void remember(const Frame& frame, const Surface& live, const Tracked& tracked, StageTimes& times);
  void follow(const Fused& fused, StageTimes& times);
  /// Stores the pose of a held-out frame and fills the report.
  void hold_out(const Frame& frame, const Tracked& tracked, FrameReport& report);

  /// Moves the whole map into submaps.
  void end_everything();
  /// Volume of the whole map.
  [[nodiscard]] Volume& world();
  /// Fusion options with the device memory limit of the whole map, which is held in addition to the volume.
  [[nodiscard]] FuseOptions world_pool() const;
  [[nodiscard]] int recordings() const;
  /// Gravity alignment of the map for export.
  [[nodiscard]] Upright upright() const;
  /// In the exported world frame.
  [[nodiscard]] Trajectory trajectory(int recording) const;
  [[nodiscard]] Statistics statistics() const;

  Options options;
  Rig rig;
  MapFiles files;
  gpu::Device device;
  Preprocessor preprocessor;
  Integrator integrator;
  Polygonizer polygonizer;
  Volume volume;
  BackEnd back_end;
  Tracker tracker;
  std::list<GrowingSurface> surfaces;  // one per LiveSurface
  std::optional<Esdf> esdf;            // with EsdfOptions::live
  Newest<DistanceField> live_distances;
  std::optional<Volume> whole;  // the world, if it differs from `volume`

  /// With Poses::given.
  struct GivenPoses {
    Trajectory poses;
    KeyframeStore images;                                     // with Options::keep_keyframes
    std::vector<std::pair<std::size_t, double>> keyframes;    // indices into `poses`; delays of the color images
    std::vector<std::pair<std::size_t, Structure>> views;     // indices into `poses`; surface orientations
    Eigen::Vector4d accelerations = Eigen::Vector4d::Zero();  // see DownEvidence
  } given;

  std::optional<double> last_fused;  // timestamp of the last fused or held-out frame
  std::size_t last_image = 0;        // hash of the last frame's depth
  int repeats = 0;                   // frames since this image was new
  std::uint32_t fused_count = 0;     // frames
  Poses poses;

 private:
  [[nodiscard]] bool is_stuck(const Frame& frame);
  void keep_given_keyframe(const Frame& frame, const Surface& live);
  void note_given_view(const Frame& frame, const Surface& live);
  void follow_distances(const Fused& fused, StageTimes& times);
};

}  // namespace cairn
