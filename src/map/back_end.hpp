// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Global consistency: keyframes, submaps, loops, and where the pose graph says they lie.
#pragma once
#include <functional>
#include <future>
#include <optional>
#include <utility>

#include "base/warnings.hpp"
#include "map/atlas.hpp"
#include "map/drift.hpp"
#include "map/match.hpp"
#include "map/settling.hpp"
#include "map/structure.hpp"
#include "map/submaps.hpp"
#include "map/world.hpp"
#include "place/keyframe_database.hpp"

namespace cairn {

class BackEnd {
 public:
  /// `files`: the folder where keyframes and submaps are, or are to be written; empty: all stays in memory.
  /// `parts`: other maps' files that this one is made of.
  BackEnd(gpu::Device& device, const Rig& rig, const Options& options, const std::filesystem::path& files = {},
          Access access = Access::write, const std::vector<PartFiles>& parts = {});

  /// Takes a fused frame: perhaps as a keyframe, which is then looked for among all earlier ones beside tracking, and
  /// perhaps as the last of its submap. `information` is of its alignment with the map, in its own frame; none for the
  /// first of a piece. `fused_count` counts fused frames. Returns whether it became a keyframe.
  bool add(const Frame& frame, const Surface& live, const Eigen::Isometry3d& submap_from_camera,
           const Matrix6d* information, Volume& volume, std::uint32_t fused_count);
  /// Takes the pose of a frame that is held out: it is part of the trajectory and of nothing else. Returns whether
  /// there is something that it lies to: a piece must have begun.
  [[nodiscard]] bool hold_out(double timestamp, const Eigen::Isometry3d& submap_from_camera);
  /// Ends the submap that is being fused into. `keep`: what lies near the camera stays in the volume for the next one.
  void end_submap(Volume& volume, std::uint32_t fused_count, bool keep);

  /// Waits for the pose graph at work and optimises once more if loops came since.
  void settle();
  /// Whether the world is what the volume holds: one submap, nothing moved.
  [[nodiscard]] bool is_plain() const;
  /// Tells that all frames of the main piece were fused again with these poses in the world, keyframes with theirs,
  /// from fused_count `since` on: they are one submap now, the one being fused into. The depth that keyframes keep is
  /// corrected.
  void rebase(std::uint32_t since, const Trajectory& poses, const DepthCorrection& correction);
  /// Waits until keyframes and ended submaps are in their files. Returns why they could not be written, if so.
  [[nodiscard]] std::optional<std::string> store();

  /// What it knows beside the files of keyframes and submaps, to go on with later.
  struct Memory {
    Atlas atlas;
    std::vector<bool> submaps;                                          // by number: whether it has a file
    std::vector<std::optional<Eigen::Isometry3d>> tracked_from_camera;  // see DatabaseEntry
    std::size_t searched = 0, submap_begin = 0;
    std::uint32_t submap_since = 1;
    bool in_world = false, breaks = true, searching = false;
    Settling::Memory settling;
  };
  [[nodiscard]] Memory memory() const;
  /// Reads the files. Throws std::runtime_error if one is missing or broken.
  void restore(const Memory& memory);
  /// Loops between the own keyframes, by edge.i, and those of another map, by edge.j.
  [[nodiscard]] std::vector<Loop> match(const BackEnd& other);
  /// Adds the ended submaps of another session and looks for its keyframes among the own ones. Returns the number of
  /// loops and whether they join the two.
  std::pair<int, bool> append(const BackEnd& other);
  /// Prepares for a recording that begins somewhere in the map: tracking goes on in the world's frame, against `world`.
  void begin_in_world();
  /// Ended submaps of the main piece, as the pose graph bends them; `only`: of these, sorted.
  [[nodiscard]] std::vector<PlacedSubmap> placed_submaps(const std::vector<std::size_t>* only = nullptr) const;
  /// Brings the world up to date with the ended submaps of the main piece.
  World& world();
  /// The same world, to be made part by part. Submaps leave the memory. `only`: of these submaps, sorted.
  [[nodiscard]] WorldParts world_parts(gpu::Device& device, const std::vector<std::size_t>* only = nullptr);
  /// What is free in it, without voxels.
  [[nodiscard]] BrickTree world_free(const std::vector<std::size_t>* only = nullptr);
  /// Gives submaps' voxels. One whose file is lost is told of and has none.
  [[nodiscard]] LoadSubmap load_submap();
  [[nodiscard]] LoadFree load_free();

  /// Whether tracking may have slipped so far that this is how two keyframes lie: its noise, added up from the one to
  /// the other, against rooms that look alike.
  [[nodiscard]] bool is_possible(std::size_t from, std::size_t to, const Eigen::Isometry3d& i_from_j) const;

  /// What points up, as somebody asks for it now: what was settled before no longer counts.
  void ask_up(Up up);
  [[nodiscard]] const KeyframeDatabase& keyframes() const { return database_; }
  [[nodiscard]] const Atlas& atlas() const { return atlas_; }
  [[nodiscard]] Atlas& atlas() { return atlas_; }
  [[nodiscard]] const Submaps& submaps() const { return submaps_; }
  [[nodiscard]] const KeyframeStore& images() const { return images_; }
  [[nodiscard]] SurfaceMatcher& matcher() { return matcher_; }
  [[nodiscard]] const Camera& camera() const { return rig_.depth; }
  [[nodiscard]] Structure structure(const Frame& frame) const { return structure_.find(frame.depth); }
  /// Stages of the map that failed and are left out.
  [[nodiscard]] Warnings& warnings() { return warnings_; }
  [[nodiscard]] const Warnings& warnings() const { return warnings_; }

  struct Counts {
    int looked_up = 0, tried = 0;       // keyframes; pairs that were aligned
    double graph_ms = 0, world_ms = 0;  // the longest
  };
  [[nodiscard]] const Counts& counts() const { return counts_; }

 private:
  /// Earlier keyframes whose corners a keyframe sees, the most similar first.
  using Seen = std::vector<std::pair<std::size_t, PnpPose>>;
  /// Among those before `before`.
  [[nodiscard]] Seen look_up(const Features& features, std::size_t before) const;
  /// Tells whether two keyframes may lie like this.
  using IsPossible = std::function<bool(std::size_t from, const Eigen::Isometry3d& from_to)>;
  /// The first of them that the surfaces agree with: `to` is a keyframe of `images`.
  [[nodiscard]] std::optional<Loop> verify(std::size_t to, const KeyframeStore& images, const Seen& seen,
                                           const IsPossible& may_lie);
  [[nodiscard]] std::optional<Loop> verify(std::size_t to, const Seen& seen);
  /// All keyframes can be found.
  void index_keyframes();
  void start_searching();
  [[nodiscard]] bool take_found();
  void leave_frame();
  void tie_to_world(const Matrix6d* information);
  void attempt_settling(const std::function<void()>& stage);
  [[nodiscard]] bool is_new_view(const Eigen::Isometry3d& submap_from_camera) const;
  [[nodiscard]] bool was_seen_before(const Eigen::Isometry3d& submap_from_camera) const;
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
  Drift drift_;  // of the atlas' keyframes
  World world_;
  Atlas atlas_;
  std::size_t searched_ = 0;        // keyframes before it are looked for: tracking may not see what they saw
  std::size_t submap_begin_ = 0;    // first keyframe of the submap that is being fused into
  std::uint32_t submap_since_ = 1;  // its first fused_count
  bool in_world_ = false;           // the next frame is tracked in the frame of the world
  bool breaks_ = true;              // the next frame begins a piece
  bool optimises_ = true;           // no optimisation has failed
  std::future<Seen> searching_;     // for the last keyframe
  Settling settling_;
  Counts counts_;
  Warnings warnings_;
};

}  // namespace cairn
