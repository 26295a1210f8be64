// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// State of the map: keyframes, their poses and constraints, and submaps.
#pragma once
#include <vector>

#include "cairn/mapping/pose_graph.hpp"
#include "cairn/mapping/surface_sigma.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "graph/inertial_graph.hpp"
#include "gravity/align_gravity.hpp"
#include "map/fused_frames.hpp"
#include "map/keyframe.hpp"

namespace cairn {

/// Loop closure between two keyframes.
struct Loop {
  PoseGraph::Edge edge;
  int feature_inliers = 0;            // feature inliers; 0: candidate found by nearby poses
  double inlier_share = 0, rmse = 0;  // of the dense alignment
  bool inlier = true;                 // according to the pose graph
};

/// Relative pose of a keyframe and its predecessor after bundle adjustment.
struct AdjustedStep {
  Eigen::Isometry3d before_from_camera = Eigen::Isometry3d::Identity();
  Matrix6d information = Matrix6d::Zero();  // in the camera's frame, 1/rad^2, 1/m^2; zero: unknown
};

/// Gravity direction in a keyframe's camera frame, so that it moves with the keyframe in pose graph optimization.
struct FrozenGravity {
  std::size_t keyframe = 0;
  GravityEstimate found;
};

/// Keyframes, submaps and loop closures of a map. Tracking and fusion work in the submaps' frame; the keyframe poses,
/// optimized by the pose graph, place this frame in the world. All submaps of a component share one frame, the frame of
/// continuous tracking; only their keyframes' world poses move submaps against each other.
struct Atlas {
  std::vector<Keyframe> keyframes;
  std::vector<Eigen::Isometry3d> world_from_camera;  // by keyframe
  std::vector<Loop> loops;
  FusedFrames frames;
  std::vector<std::size_t> recordings;          // first frame of each recording after the first
  std::optional<Up> up;                         // as requested
  std::optional<FrozenGravity> frozen_gravity;  // frozen when the map was written before another recording extended it
  SurfaceSigma surface_sigma;       // of the last bundle adjustment, cleared when keyframes move; empty: unknown
  std::vector<AdjustedStep> steps;  // of the last bundle adjustment, by keyframe; later keyframes have none
  std::optional<InertialMount> inertial_mount;  // none: no trusted inertial sensor

  /// Adds a keyframe at its tracked pose.
  void add(const Keyframe& keyframe);
  /// Adds a frame: the newest keyframe itself or a later frame.
  void add_frame(double timestamp, const Eigen::Isometry3d& submap_from_camera,
                 const std::optional<Eigen::Vector3d>& acceleration = {});
  [[nodiscard]] Eigen::Isometry3d submap_from_camera(const FusedFrame& frame) const;
  /// Correction of a keyframe: world_from_submap at its position.
  [[nodiscard]] Eigen::Isometry3d correction(std::size_t keyframe) const;
  /// Connected components by tracking and loop closures: for each keyframe, the index of the first keyframe of its
  /// component.
  [[nodiscard]] std::vector<std::size_t> components() const;
  /// First keyframe of the largest component.
  [[nodiscard]] std::size_t main_component() const;
  /// Keyframes of the main component, in order.
  [[nodiscard]] std::vector<std::size_t> main_keyframes() const;
  [[nodiscard]] PoseGraph graph() const { return graph(keyframes.size(), loops.size()); }
  /// Pose graph of the first keyframes and loop closures. The loop closures must connect only these keyframes.
  [[nodiscard]] PoseGraph graph(std::size_t keyframe_count, std::size_t loop_count) const;
  /// Inertial measurements of the first keyframes, for graph(). None without a trusted sensor.
  [[nodiscard]] std::optional<InertialGraph> inertial_graph(std::size_t keyframe_count) const;
  /// Removes the measurements of a sensor that contradicts the tracked motion.
  void forget_inertial();
  /// Weights of graph()'s edges: 1 for inliers, 0 for rejected loop closures.
  [[nodiscard]] std::vector<double> edge_weights() const;
  /// Takes over the result of optimize() on a graph of this atlas. Later keyframes and loop closures are kept.
  void update_poses(const PoseGraph& graph, const OptimizeReport& report,
                    const std::optional<InertialGraph>& inertial = {});
  /// Moves one keyframe's component rigidly to satisfy the measured relative pose.
  void align_components(const PoseGraph::Edge& edge);
  /// Trajectory of a component: every `step`-th frame from `begin` to `end`, and the last. Corrections are interpolated
  /// between keyframes.
  [[nodiscard]] Trajectory trajectory(std::size_t component, std::size_t begin, std::size_t end,
                                      std::size_t step = 1) const;
  /// Gravity alignment of the main component for export: frozen, or else estimated from all evidence.
  [[nodiscard]] GravityAlignment upright() const;
  /// Freezes the gravity direction at upright(). Later recordings do not change it; further frames of the first
  /// recording, which may only have been interrupted, still do. Without evidence it stays open.
  void freeze_gravity();

 private:
  /// Odometry edge from the preceding keyframe to a keyframe that follows it.
  [[nodiscard]] PoseGraph::Edge odometry_edge(std::size_t keyframe) const;
  /// The same motion by the device's own tracking. None if it is no measurement, or if the adjusted step contains it.
  [[nodiscard]] std::optional<PoseGraph::Edge> device_edge(std::size_t keyframe) const;
  [[nodiscard]] GravityEvidence gravity_evidence() const;
  /// Takes over the gravity estimated with the poses.
  void update_gravity(const InertialGraph& inertial);
  [[nodiscard]] std::optional<FrozenGravity> frozen_or_estimated(const GravityEvidence& evidence) const;
};

}  // namespace cairn
