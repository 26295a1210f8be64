// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a mapper holds: the stages, the volume that is being fused into, and the back end. Mapper, Map, Session and
// LiveSurface each show another side of it.
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

/// Where keyframes and submaps are kept.
struct MapFiles {
  std::filesystem::path folder;  // empty: in memory
  Access access = Access::write;
  std::shared_ptr<const void> hold;  // sees to it that they stay as long as this lives
  std::vector<PartFiles> parts;      // of other maps that this one is made of
};

struct MapState {
  MapState(const Rig& rig, const Options& options, Poses poses, int device, MapFiles files = {});

  [[nodiscard]] Warnings& warnings() { return back_end.warnings(); }
  [[nodiscard]] bool is_tracked() const { return poses == Poses::tracked; }

  // The stages of Mapper::add that are not another room's.
  [[nodiscard]] CheckedFrame check(const Frame& frame);
  /// `motion`: of the camera, for a rolling shutter.
  [[nodiscard]] Surface see(const Frame& frame, const MotionAt& motion, StageTimes& times);
  /// Sees a frame and finds where it was taken.
  [[nodiscard]] Tracked locate(const Frame& frame, Surface& seen, StageTimes& times);
  /// Whether the frame is fused with its colour, where that has to be brought to depth.
  [[nodiscard]] bool is_colour_due(const Tracked& tracked) const;
  /// Of so many frames one's rays are followed through free space, where the camera moves on like this from frame to
  /// frame.
  [[nodiscard]] std::uint32_t look_every(const std::optional<Eigen::Isometry3d>& motion) const;
  /// From the last fused frame's camera to this one's.
  [[nodiscard]] std::optional<Eigen::Isometry3d> motion(const Tracked& tracked) const;
  void begin_component();
  void remember(const Frame& frame, const Surface& live, const Tracked& tracked, StageTimes& times);
  void follow(const Fused& fused, StageTimes& times);
  /// Keeps the pose of a frame that is held out, and tells what became of it.
  void hold_out(const Frame& frame, const Tracked& tracked, FrameReport& report);

  /// All of the map goes to submaps.
  void end_everything();
  /// The volume of the whole map.
  [[nodiscard]] Volume& world();
  /// How much of the device the whole map may take while it is looked at beside the volume.
  [[nodiscard]] FuseOptions world_pool() const;
  [[nodiscard]] int recordings() const;
  /// How the map is turned where it is written.
  [[nodiscard]] Upright upright() const;
  /// In the world that is written.
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
  std::list<GrowingSurface> surfaces;  // one for each LiveSurface
  std::optional<Esdf> esdf;            // with EsdfOptions::live
  Newest<DistanceField> live_distances;
  std::optional<Volume> whole;  // the world, where that is not what `volume` holds

  /// With Poses::given.
  struct GivenPoses {
    Trajectory poses;
    KeyframeStore images;                                     // with Options::keep_keyframes
    std::vector<std::pair<std::size_t, double>> keyframes;    // of `poses`; the colour images' delays
    std::vector<std::pair<std::size_t, Structure>> views;     // of `poses`; where what they show faces
    Eigen::Vector4d accelerations = Eigen::Vector4d::Zero();  // see DownEvidence
  } given;

  std::optional<double> last_fused;  // timestamp; of a frame that was held out as well
  std::size_t last_image = 0;        // hash of the last frame's depth
  int repeats = 0;                   // frames since that image was new
  std::uint32_t fused_count = 0;     // frames
  Poses poses;

 private:
  [[nodiscard]] bool is_stuck(const Frame& frame);
  void keep_given_keyframe(const Frame& frame, const Surface& live);
  void note_given_view(const Frame& frame, const Surface& live);
  void follow_distances(const Fused& fused, StageTimes& times);
};

}  // namespace cairn
