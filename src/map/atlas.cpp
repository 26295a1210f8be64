// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/atlas.hpp"

#include <algorithm>
#include <limits>
#include <map>

#include "base/union_find.hpp"
#include "graph/inflate_information.hpp"

namespace cairn {
namespace {

constexpr double kAccelerometerSigma = 0.1;  // rad: a hand accelerates by a tenth of g

}  // namespace

void Atlas::add(const Keyframe& keyframe) {
  world_from_camera.push_back(keyframe.follows ? correction(keyframes.size() - 1) * keyframe.submap_from_camera
                                               : keyframe.submap_from_camera);
  keyframes.push_back(keyframe);
}

void Atlas::add_frame(double timestamp, const Eigen::Isometry3d& submap_from_camera,
                      const std::optional<Eigen::Vector3d>& acceleration) {
  const Eigen::Isometry3d keyframe_from_camera = keyframes.back().submap_from_camera.inverse() * submap_from_camera;
  if (acceleration)
    keyframes.back().accelerations +=
        (Eigen::Vector4d() << keyframe_from_camera.linear() * *acceleration, acceleration->norm()).finished();
  if (recordings.empty()) frozen_gravity.reset();
  frames.push_back({timestamp, static_cast<std::uint32_t>(keyframes.size() - 1),
                    local_coordinates(keyframe_from_camera).cast<float>()});
}

Eigen::Isometry3d Atlas::submap_from_camera(const FusedFrame& frame) const {
  return keyframes[frame.keyframe].submap_from_camera * retract(frame.twist.cast<double>());
}

Eigen::Isometry3d Atlas::correction(std::size_t keyframe) const {
  return world_from_camera[keyframe] * keyframes[keyframe].submap_from_camera.inverse();
}

std::vector<std::size_t> Atlas::components() const {
  UnionFind<std::size_t> sets(keyframes.size());
  for (std::size_t k = 1; k < keyframes.size(); ++k)
    if (keyframes[k].follows) sets.join(k - 1, k);
  for (const Loop& loop : loops)
    if (loop.inlier) sets.join(loop.edge.i, loop.edge.j);
  return sets.all();
}

std::size_t Atlas::main_component() const {
  std::map<std::size_t, std::size_t> count;
  for (const std::size_t first : components()) ++count[first];
  std::size_t main = 0;
  for (const auto& [first, size] : count)
    if (size > count[main]) main = first;
  return main;
}

std::vector<std::size_t> Atlas::main_keyframes() const {
  const auto component_of = components();
  const std::size_t main = main_component();
  std::vector<std::size_t> keyframes_of_main;
  for (std::size_t k = 0; k < keyframes.size(); ++k)
    if (component_of[k] == main) keyframes_of_main.push_back(k);
  return keyframes_of_main;
}

PoseGraph Atlas::graph(std::size_t keyframe_count, std::size_t loop_count) const {
  PoseGraph graph;
  for (std::size_t k = 0; k < keyframe_count; ++k) {
    graph.world_from_node.push_back(world_from_camera[k]);
    const Keyframe& keyframe = keyframes[k];
    if (const auto& at_rest = keyframe.acceleration; at_rest && at_rest->norm() > 0 && !inertial_mount)
      graph.gravity.push_back({.node = k, .up = at_rest->normalized(), .sigma = kAccelerometerSigma});
    if (!keyframe.follows) continue;
    if (const auto by_device = device_edge(k)) graph.edges.push_back(*by_device);
    graph.edges.push_back(odometry_edge(k));
  }
  for (std::size_t k = 0; k < loop_count; ++k) graph.edges.push_back(loops[k].edge);
  return graph;
}

std::optional<InertialGraph> Atlas::inertial_graph(std::size_t keyframe_count) const {
  if (!inertial_mount) return std::nullopt;
  InertialGraph inertial{.mount = *inertial_mount};
  for (std::size_t k = 0; k < keyframe_count; ++k) {
    const InertialKeyframe& measured = keyframes[k].inertial;
    inertial.gravity.push_back(
        measured.gravity ? std::optional(Eigen::Vector3d(kStandardGravity * measured.gravity->down)) : std::nullopt);
    if (k > 0 && measured.step) inertial.steps.push_back({k - 1, k, *measured.step});
  }
  return inertial;
}

void Atlas::forget_inertial() {
  inertial_mount.reset();
  for (Keyframe& keyframe : keyframes) keyframe.inertial = {};
}

PoseGraph::Edge Atlas::odometry_edge(std::size_t keyframe) const {
  const Keyframe &before = keyframes[keyframe - 1], &after = keyframes[keyframe];
  if (keyframe < steps.size() && !steps[keyframe].information.isZero())
    return {.i = keyframe - 1,
            .j = keyframe,
            .i_from_j = steps[keyframe].before_from_camera,
            .information = steps[keyframe].information,
            .heavy_tailed = true};
  return {.i = keyframe - 1,
          .j = keyframe,
          .i_from_j = before.odometry_from_camera.inverse() * after.odometry_from_camera,
          .information = inflate_information(after.information)};
}

std::optional<PoseGraph::Edge> Atlas::device_edge(std::size_t keyframe) const {
  const Keyframe &before = keyframes[keyframe - 1], &after = keyframes[keyframe];
  const bool is_adjusted = keyframe < steps.size() && !steps[keyframe].information.isZero();
  if (is_adjusted || !after.device_drift || !before.device_pose || !after.device_pose) return std::nullopt;
  const Eigen::Isometry3d motion = before.device_pose->inverse() * *after.device_pose;
  return PoseGraph::Edge{.i = keyframe - 1,
                         .j = keyframe,
                         .i_from_j = motion,
                         .information = device_covariance(*after.device_drift, motion).inverse(),
                         .heavy_tailed = true};
}

std::vector<double> Atlas::edge_weights() const {
  std::vector<double> weights;
  for (std::size_t k = 0; k < keyframes.size(); ++k)
    if (keyframes[k].follows) weights.resize(weights.size() + (device_edge(k) ? 2 : 1), 1.0);
  for (const Loop& loop : loops) weights.push_back(loop.inlier ? 1.0 : 0.0);
  return weights;
}

void Atlas::update_poses(const PoseGraph& graph, const OptimizeReport& report,
                         const std::optional<InertialGraph>& inertial) {
  const std::size_t node_count = graph.world_from_node.size();
  const auto is_equal = [](const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) { return a.matrix() == b.matrix(); };
  if (!std::equal(graph.world_from_node.begin(), graph.world_from_node.end(), world_from_camera.begin(), is_equal))
    surface_sigma = {};
  std::copy(graph.world_from_node.begin(), graph.world_from_node.end(), world_from_camera.begin());
  for (std::size_t k = node_count; k < keyframes.size(); ++k)
    if (keyframes[k].follows) world_from_camera[k] = correction(k - 1) * keyframes[k].submap_from_camera;
  if (inertial) update_gravity(*inertial);
  std::size_t loop = 0;
  for (std::size_t e = 0; e < graph.edges.size(); ++e)
    if (graph.edges[e].is_loop_closure) loops[loop++].inlier = report.edge_weights[e] > 0.5;
}

void Atlas::update_gravity(const InertialGraph& inertial) {
  double sigma = std::numeric_limits<double>::infinity();
  for (const Keyframe& keyframe : keyframes)
    if (keyframe.inertial.gravity) sigma = std::min(sigma, keyframe.inertial.gravity->sigma);
  for (std::size_t k = 0; k < inertial.gravity.size(); ++k)
    if (const auto& gravity = inertial.gravity[k])
      keyframes[k].inertial.gravity = MeasuredGravity{gravity->normalized(), sigma};
}

void Atlas::align_components(const PoseGraph::Edge& edge) {
  const auto first = components();
  if (first[edge.i] == first[edge.j]) return;
  surface_sigma = {};
  const bool is_first_fixed = first[edge.i] < first[edge.j];
  const std::size_t moving = is_first_fixed ? edge.j : edge.i;
  const Eigen::Isometry3d target =
      is_first_fixed ? world_from_camera[edge.i] * edge.i_from_j : world_from_camera[edge.j] * edge.i_from_j.inverse();
  const Eigen::Isometry3d move = target * world_from_camera[moving].inverse();
  for (std::size_t k = 0; k < keyframes.size(); ++k)
    if (first[k] == first[moving]) world_from_camera[k] = move * world_from_camera[k];
}

Trajectory Atlas::trajectory(std::size_t component, std::size_t begin, std::size_t end, std::size_t step) const {
  const auto component_of = components();
  Trajectory trajectory;
  end = std::min(end, frames.size());
  for (std::size_t i = begin; i < end; i += i + 1 < end ? std::min(step, end - 1 - i) : 1) {
    const FusedFrame& frame = frames[i];
    const std::size_t k = frame.keyframe, next = k + 1;
    if (component_of[k] != component) continue;
    Eigen::Isometry3d move = correction(k);
    if (next < keyframes.size() && keyframes[next].follows && frame.timestamp < keyframes[next].timestamp) {
      const double before = keyframes[k].timestamp, after = keyframes[next].timestamp;
      // Interpolates in the earlier keyframe's camera frame, so that distant points do not swing.
      const Eigen::Isometry3d &at = world_from_camera[k], &was = keyframes[k].submap_from_camera;
      const Eigen::Isometry3d rest = at.inverse() * correction(next) * was;
      move = at * retract((frame.timestamp - before) / (after - before) * local_coordinates(rest)) * was.inverse();
    }
    Eigen::Isometry3d pose = move * submap_from_camera(frame);
    pose.linear() = Eigen::Quaterniond(pose.linear()).normalized().toRotationMatrix();
    trajectory.push_back({frame.timestamp, pose});
  }
  return trajectory;
}

/// Of the main component.
GravityEvidence Atlas::gravity_evidence() const {
  const auto component_of = components();
  const std::size_t main = main_component();
  GravityEvidence evidence{.world_from_first_camera = world_from_camera[main].linear()};
  Eigen::Vector3d down = Eigen::Vector3d::Zero();
  double sigma = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    if (component_of[k] != main) continue;
    const Eigen::Matrix3d rotation = world_from_camera[k].linear();
    evidence.views.push_back({rotation, &keyframes[k].structure});
    evidence.accelerations.head<3>() += rotation * keyframes[k].accelerations.head<3>();
    evidence.accelerations[3] += keyframes[k].accelerations[3];
    if (const auto& gravity = keyframes[k].inertial.gravity) {
      down += rotation * gravity->down / (gravity->sigma * gravity->sigma);
      sigma = std::min(sigma, gravity->sigma);
    }
  }
  if (down.norm() > 0) evidence.inertial = MeasuredGravity{down.normalized(), sigma};
  return evidence;
}

/// The frozen direction, or else an estimate from the evidence.
std::optional<FrozenGravity> Atlas::frozen_or_estimated(const GravityEvidence& evidence) const {
  const std::size_t main = main_component();
  if (frozen_gravity && components()[frozen_gravity->keyframe] == main) return frozen_gravity;
  auto found = estimate_gravity(evidence, up.value_or(Up::automatic));
  if (!found) return std::nullopt;
  found->down = world_from_camera[main].linear().transpose() * found->down;
  return FrozenGravity{.keyframe = main, .found = *std::move(found)};
}

GravityAlignment Atlas::upright() const {
  if (keyframes.empty()) return unknown_gravity_alignment();
  const GravityEvidence evidence = gravity_evidence();
  auto down = frozen_or_estimated(evidence);
  if (!down) return unknown_gravity_alignment();
  down->found.down = world_from_camera[down->keyframe].linear() * down->found.down;
  return gravity_alignment_of(down->found, evidence);
}

void Atlas::freeze_gravity() {
  if (!keyframes.empty()) frozen_gravity = frozen_or_estimated(gravity_evidence());
}

}  // namespace cairn
