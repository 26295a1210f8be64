// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Global consistency: keyframes, submaps, loop closures, and their poses from the pose graph.
#pragma once
#include <functional>
#include <future>
#include <optional>
#include <utility>

#include "base/warnings.hpp"
#include "gravity/structure.hpp"
#include "inertial/inertial_odometry.hpp"
#include "loop_closing/drift.hpp"
#include "loop_closing/match.hpp"
#include "map/atlas.hpp"
#include "map/global_volume.hpp"
#include "map/submaps.hpp"
#include "mapper/graph_scheduler.hpp"
#include "place/keyframe_database.hpp"

namespace cairn {

/// Measurements of a frame's pose by other sensors than the depth camera.
struct OtherSensors {
  std::optional<DeviceDrift> drift;  // of the frame's device pose, if it is a measurement
  /// Inertial measurements of a keyframe; called once per keyframe.
  std::function<InertialKeyframe()> inertial;
  std::optional<InertialMount> mount;  // of a trusted inertial sensor
  bool is_inertial_contradicted = false;
  /// Pose of the first frame of a component, in the frame of the preceding one.
  std::optional<InertialOdometry::Prediction> before_break;
};

class BackEnd {
 public:
  /// `files`: folder where keyframes and submaps are read and written; empty: all data stays in memory. `source_maps`:
  /// files of the maps merged into this map.
  BackEnd(gpu::Device& device, const Rig& rig, const Options& options, const std::filesystem::path& files = {},
          Access access = Access::write, const std::vector<SourceMapFiles>& source_maps = {});

  /// Adds a fused frame. The frame may become a keyframe, with a concurrent loop closure search among all earlier
  /// keyframes, and may end its submap. `information`: of its alignment with the map, in its own frame; null for the
  /// first frame of a component. `fused_count`: number of fused frames. Returns true if the frame became a keyframe.
  bool add(const Frame& frame, const FramePyramid& live, const Eigen::Isometry3d& submap_from_camera,
           const Matrix6d* information, const OtherSensors& sensors, Volume& volume, std::uint32_t fused_count);
  /// Adds the pose of a held-out frame to the trajectory only. Returns false if no component has started yet.
  [[nodiscard]] bool hold_out(double timestamp, const Eigen::Isometry3d& submap_from_camera);
  /// Ends the active submap. `keep`: voxels near the camera stay in the volume for the next submap.
  void end_submap(Volume& volume, std::uint32_t fused_count, bool keep);

  /// Waits for the running pose graph optimization, and optimizes once more if loop closures were added since.
  void finish_optimization();
  /// True if the world equals the volume: a single submap, without corrections.
  [[nodiscard]] bool is_undeformed() const;
  /// Records that all frames of the main component were fused again with these world poses, from fused_count `since`
  /// on. All become one submap, the active one, and keyframes take these poses. The correction is applied to the
  /// keyframes' stored depth.
  void rebase(std::uint32_t since, const Trajectory& poses, const DepthCorrection& correction);
  /// Replaces the stored images of a keyframe; its features stay.
  void replace_images(std::size_t keyframe, const Frame& images) {
    images_.put(keyframe, images, *images_.features(keyframe));
  }
  /// Waits until keyframes and ended submaps are in their files. Returns the reason if some could not be written.
  [[nodiscard]] std::optional<std::string> store();

  /// State for resuming, in addition to the files of keyframes and submaps.
  struct State {
    Atlas atlas;
    std::vector<bool> submaps;                                          // by number: true if it has a file
    std::vector<std::optional<Eigen::Isometry3d>> tracked_from_camera;  // see DatabaseEntry
    std::size_t searched = 0, submap_begin = 0;
    std::uint32_t submap_since = 1;
    std::size_t inertial_keyframes = 0;
    bool tracks_in_world = false, starts_component = true, searching = false;
    GraphScheduler::State scheduler;
  };
  [[nodiscard]] State save() const;
  /// Reads the files. Throws std::runtime_error if a file is missing or broken.
  void restore(const State& state);
  /// Loop closures between own keyframes (edge.i) and keyframes of another map (edge.j).
  [[nodiscard]] std::vector<Loop> match(const BackEnd& other);
  /// Prepares for a recording that starts somewhere in the map: tracking continues in the world frame, against
  /// `global_volume`.
  void begin_recording();
  /// Ended submaps of the main component, deformed by the pose graph. `only`: subset of submaps, sorted.
  [[nodiscard]] std::vector<PlacedSubmap> placed_submaps(const std::vector<std::size_t>* only = nullptr) const;
  /// Updates the world with the ended submaps of the main component.
  GlobalVolume& global_volume();
  /// The same world for export in chunks. Submaps are released from memory. `only`: subset of submaps, sorted.
  [[nodiscard]] GlobalVolumeChunks global_volume_chunks(gpu::Device& device,
                                                        const std::vector<std::size_t>* only = nullptr);
  /// Free space of the same world, without voxels.
  [[nodiscard]] BrickTree global_free_space(const std::vector<std::size_t>* only = nullptr);
  /// Loads the voxels of submaps. A lost file causes a warning and an empty result.
  [[nodiscard]] LoadSubmap load_submap();
  [[nodiscard]] LoadFree load_free();

  /// Plausibility test of a relative pose: true if its deviation from the current estimate is within the accumulated
  /// noise of tracking. Rejects similar rooms.
  [[nodiscard]] bool is_possible(std::size_t from, std::size_t to, const Eigen::Isometry3d& i_from_j) const;

  /// Sets the up axis as requested and discards a frozen gravity direction.
  void set_up_axis(Up up);
  [[nodiscard]] const KeyframeDatabase& keyframes() const { return database_; }
  [[nodiscard]] const Atlas& atlas() const { return atlas_; }
  [[nodiscard]] Atlas& atlas() { return atlas_; }
  [[nodiscard]] const Submaps& submaps() const { return submaps_; }
  [[nodiscard]] const KeyframeStore& images() const { return images_; }
  [[nodiscard]] SurfaceMatcher& matcher() { return matcher_; }
  [[nodiscard]] const Camera& camera() const { return rig_.depth; }
  [[nodiscard]] Structure structure(const Frame& frame) const { return structure_.find(frame.depth); }
  /// Map stages that failed and were disabled.
  [[nodiscard]] Warnings& warnings() { return warnings_; }
  [[nodiscard]] const Warnings& warnings() const { return warnings_; }

  struct Counts {
    int database_queries = 0, tried = 0;  // keyframes; aligned pairs
    double graph_ms = 0, world_ms = 0;    // maxima
  };
  [[nodiscard]] const Counts& counts() const { return counts_; }

 private:
  /// Earlier keyframes with feature matches to a keyframe, most similar first.
  using Candidates = std::vector<std::pair<std::size_t, PnpPose>>;
  /// Searches among keyframes before `before`.
  [[nodiscard]] Candidates find_candidates(const Features& features, std::size_t before) const;
  /// Plausibility test of the relative pose of two keyframes.
  using IsPossible = std::function<bool(std::size_t from, const Eigen::Isometry3d& from_to)>;
  /// First candidate whose surface aligns with `to`, a keyframe of `images`.
  [[nodiscard]] std::optional<Loop> verify(std::size_t to, const KeyframeStore& images, const Candidates& candidates,
                                           const IsPossible& is_possible_pose);
  [[nodiscard]] std::optional<Loop> verify(std::size_t to, const Candidates& candidates);
  /// Makes all keyframes available for place recognition.
  void index_keyframes();
  void start_search();
  [[nodiscard]] bool take_search_result();
  void begin_component();
  /// Extracts the features of a keyframe beside tracking.
  void start_features(const FramePyramid& live);
  /// Waits for the features of the last keyframe. Their failure is a warning.
  void await_features();
  void add_anchor_edge(const Matrix6d* information);
  void add_inertial_edge(const InertialOdometry::Prediction& before_break);
  void optimize_inertially();
  void attempt_optimization(const std::function<void()>& stage);
  [[nodiscard]] bool is_new_view(const Eigen::Isometry3d& submap_from_camera) const;
  [[nodiscard]] bool is_covered_by_earlier_submaps(const Eigen::Isometry3d& submap_from_camera) const;
  [[nodiscard]] bool is_full(const Eigen::Isometry3d& submap_from_camera, const Volume& volume) const;

  gpu::Device& device_;
  Rig rig_;
  Options options_;
  Access access_;
  SurfaceMatcher matcher_;
  StructureFinder structure_;
  KeyframeStore images_;
  Submaps submaps_;
  KeyframeDatabase database_;
  Drift drift_;  // over the atlas' keyframes
  GlobalVolume global_volume_;
  Atlas atlas_;
  std::size_t searched_ = 0;            // keyframes before this index are searched: tracking may not see their surface
  std::size_t submap_begin_ = 0;        // first keyframe of the active submap
  std::uint32_t submap_since_ = 1;      // its first fused_count
  std::size_t inertial_keyframes_ = 0;  // keyframes at the last optimization with inertial measurements
  bool tracks_in_world_ = false;        // the next frame is tracked in the world frame
  bool starts_component_ = true;        // the next frame starts a component
  bool optimizes_ = true;               // false once an optimization has failed
  std::future<Candidates> search_;      // for the last keyframe
  FutureFeatures features_;             // of the last keyframe
  GraphScheduler scheduler_;
  Counts counts_;
  Warnings warnings_;
};

}  // namespace cairn
