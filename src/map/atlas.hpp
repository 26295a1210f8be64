// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What the map knows as a whole: keyframes, how they lie to each other, and submaps.
#pragma once
#include <vector>

#include "cairn/pose_graph.hpp"
#include "cairn/surface_sigma.hpp"
#include "cairn/trajectory.hpp"
#include "map/fused_frames.hpp"
#include "map/keyframe.hpp"
#include "map/upright.hpp"

namespace cairn {

/// Two keyframes that were found to see the same.
struct Loop {
  PoseGraph::Edge edge;
  int corners = 0;                    // that agreed; 0: tried since the poses lie close together
  double inlier_share = 0, rmse = 0;  // of the dense alignment
  bool inlier = true;                 // by the pose graph
};

/// How an adjustment has laid a keyframe to the one before it.
struct AdjustedStep {
  Eigen::Isometry3d before_from_camera = Eigen::Isometry3d::Identity();
  Matrix6d information = Matrix6d::Zero();  // in the camera's frame, 1/rad^2, 1/m^2; zero: not known
};

/// Down, in the camera's frame of a keyframe: it goes with the keyframe where the pose graph moves that.
struct SettledDown {
  std::size_t keyframe = 0;
  FoundDown found;
};

/// Tracking and fusion live in the submaps' frame; where that lies in the world is told by the keyframes, which the
/// pose graph moves. All submaps of a piece share one frame, that of tracking without a break; what moves one against
/// the other is their keyframes' poses in the world.
struct Atlas {
  std::vector<Keyframe> keyframes;
  std::vector<Eigen::Isometry3d> world_from_camera;  // of the keyframes
  std::vector<Loop> loops;
  FusedFrames frames;
  std::vector<std::size_t> recordings;  // the first frame of each recording after the first
  std::optional<Up> up;                 // as it was asked for
  std::optional<SettledDown> settled;   // as the map was written before another recording went on with it
  SurfaceSigma surface_sigma;           // by the last adjustment, until keyframes move otherwise; empty: not known
  std::vector<AdjustedStep> steps;      // by the last adjustment, by keyframe; those that came later have none

  /// Adds a keyframe where its tracked pose puts it.
  void add(const Keyframe& keyframe);
  /// Adds a frame, the newest keyframe or one after it.
  void add_frame(double timestamp, const Eigen::Isometry3d& submap_from_camera,
                 const std::optional<Eigen::Vector3d>& acceleration = {});
  [[nodiscard]] Eigen::Isometry3d submap_from_camera(const FusedFrame& frame) const;
  /// What a keyframe was moved by: world_from_submap at its place.
  [[nodiscard]] Eigen::Isometry3d correction(std::size_t keyframe) const;
  /// Parts that neither tracking nor a loop joins, by keyframe: the number of the first keyframe of its part.
  [[nodiscard]] std::vector<std::size_t> components() const;
  /// The first keyframe of the piece that has most keyframes.
  [[nodiscard]] std::size_t main_component() const;
  /// The keyframes of that component, in their order.
  [[nodiscard]] std::vector<std::size_t> main_keyframes() const;
  [[nodiscard]] PoseGraph graph() const { return graph(keyframes.size(), loops.size()); }
  /// Of the first keyframes and loops, which are between these.
  [[nodiscard]] PoseGraph graph(std::size_t keyframe_count, std::size_t loop_count) const;
  /// Of graph()'s edges: which of them are believed.
  [[nodiscard]] std::vector<double> edge_weights() const;
  /// Takes over what optimise() made of a graph of this atlas; keyframes and loops that came later are kept.
  void take(const PoseGraph& graph, const OptimiseReport& report);
  /// Moves the piece of one keyframe rigidly so that it lies to another as measured.
  void join(const PoseGraph::Edge& edge);
  /// Of a piece's frames from `begin` to `end`, every `step`-th and the last: corrections are interpolated between
  /// keyframes.
  [[nodiscard]] Trajectory trajectory(std::size_t piece, std::size_t begin, std::size_t end,
                                      std::size_t step = 1) const;
  /// How the main piece is turned where it is written: as it was settled, or as all that is known says.
  [[nodiscard]] Upright upright() const;
  /// From now on the map stands as upright() says, whatever other recordings tell; more of the first one, which may
  /// only have been cut off, is heard. Where nothing tells it is still open.
  void settle_upright();

 private:
  /// How a keyframe lies to the one before it, which it follows.
  [[nodiscard]] PoseGraph::Edge step(std::size_t keyframe) const;
  [[nodiscard]] DownEvidence down_evidence() const;
  [[nodiscard]] std::optional<SettledDown> settled_or_found(const DownEvidence& evidence) const;
};

}  // namespace cairn
