// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// State of a mapper: the stages, the active volume, and the back end; shared by Mapper, Map, Session and LiveSurface.
#pragma once
#include <filesystem>
#include <list>
#include <memory>
#include <optional>
#include <vector>

#include "base/latest_value.hpp"
#include "base/stopwatch.hpp"
#include "cairn/mapping/mapper.hpp"
#include "map/incremental_mesher.hpp"
#include "mapper/back_end.hpp"
#include "mapper/checked_frame.hpp"
#include "mapper/held_out_frames.hpp"
#include "mapper/pose_sources.hpp"
#include "mapper/tracker.hpp"
#include "preprocess/preprocess.hpp"
#include "volume/esdf.hpp"
#include "volume/integrate.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

/// Storage of keyframes and submaps.
struct MapFiles {
  std::filesystem::path folder;  // empty: in memory
  Access access = Access::write;
  std::shared_ptr<const void> hold;         // keeps the files alive
  std::vector<SourceMapFiles> source_maps;  // of the maps merged into this map
};

struct MapState {
  MapState(const Rig& rig, const Options& options, Poses kind, int device, MapFiles files = {});
  MapState(const MapState&) = delete;  // its members refer to each other
  MapState& operator=(const MapState&) = delete;

  [[nodiscard]] Warnings& warnings() { return back_end.warnings(); }

  // The stages of Mapper::add.
  [[nodiscard]] CheckedFrame check(const Frame& frame);
  /// Preprocesses and tracks a frame.
  [[nodiscard]] TrackingResult track(const Frame& frame, FramePyramid& seen, StageTimes& times);
  /// True if the frame is fused with color, which requires registration to depth.
  [[nodiscard]] bool is_color_due(const TrackingResult& tracked) const;
  /// Carving interval in frames, for a camera that moves like this from frame to frame.
  [[nodiscard]] std::uint32_t carving_interval(const std::optional<Eigen::Isometry3d>& motion) const;
  /// Relative pose from the last fused frame's camera to the current one.
  [[nodiscard]] std::optional<Eigen::Isometry3d> motion(const TrackingResult& tracked) const;
  void begin_component();
  void commit_frame(const Frame& frame, const FramePyramid& live, const TrackingResult& tracked, StageTimes& times);
  void update_esdf_and_mesh(const IntegrationResult& fused, StageTimes& times);
  /// Stores the pose and a sample of a held-out frame, and fills the report.
  void hold_out(const Frame& frame, const FramePyramid& seen, const TrackingResult& tracked, FrameReport& report);
  /// Compares the map with the held-out frames. Returns nullopt if they are too few.
  [[nodiscard]] std::optional<HeldOutError> held_out_error();

  /// Replaces the rig by one that differs in readout and depth correction.
  void set_rig(const Rig& calibrated);
  /// Moves the whole map into submaps.
  void end_map();
  /// Volume of the whole map.
  [[nodiscard]] Volume& global_volume();
  /// Fusion options with the device memory limit of the whole map, which is held in addition to the volume.
  [[nodiscard]] FuseOptions global_volume_options() const;
  [[nodiscard]] int recordings() const;
  /// Gravity alignment of the map for export.
  [[nodiscard]] GravityAlignment upright() const;
  /// In the exported world frame.
  [[nodiscard]] Trajectory trajectory(int recording) const;
  /// See Mapper::path.
  [[nodiscard]] Trajectory path(std::size_t points) const;
  /// Images of the keyframes.
  [[nodiscard]] const KeyframeStore& images() const;
  [[nodiscard]] Statistics statistics() const;

  Options options;
  Rig rig;
  MapFiles files;
  gpu::Device device;
  std::optional<Preprocessor> preprocessor;  // emplaced again by set_rig(), at the same address
  Integrator integrator;
  Polygonizer polygonizer;
  Volume volume;
  BackEnd back_end;
  Tracker tracker;
  std::list<IncrementalMesher> surfaces;  // one per LiveSurface
  std::optional<Esdf> esdf;               // with EsdfOptions::live
  LatestValue<DistanceField> live_distances;
  std::optional<Volume> cached_volume;  // the world, if it differs from `volume`

  std::optional<double> last_fused;  // timestamp of the last fused or held-out frame
  HeldOutFrames held_out;            // of this program
  RepeatedImages repeats;
  std::uint32_t fused_count = 0;  // frames
  PoseSource poses;

 private:
  void update_esdf(const IntegrationResult& fused, StageTimes& times);
};

}  // namespace cairn
