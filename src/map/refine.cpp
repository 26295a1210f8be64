// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/refine.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace cairn {
namespace {

constexpr double kKeyframeTurn = 0.15, kKeyframeDistance = 0.12;  // radians, metres
constexpr double kCovisibleTurn = 0.6, kCovisibleDistance = 0.8;  // between views that see much of the same
constexpr std::size_t kCovisible = 6;                             // pairs a keyframe, beside the one with the next
constexpr std::size_t kLookAlikes = 3;                            // places that a keyframe is compared with by corners
constexpr int kLoopCorners = 30;                                  // that must agree before a loop is aligned
constexpr double kMinInliers = 0.4, kMinOverlap = 0.3, kMaxRmse = 2.0;
constexpr double kSameTurn = 0.02, kSameDistance = 0.02;  // radians, metres between a loop's alignments of both ways
// Of an alignment: the part of the noise that no number of points averages out (calibration, shutter, voxels), and how
// many points count as one.
constexpr double kTurnFloor = 0.003, kShiftFloor = 0.004;
constexpr double kTogether = 100;
constexpr double kAccelerometerSigma = 0.1;  // radians: a hand accelerates by a tenth of g

Matrix6d calibrated(const Matrix6d& information) {
  Matrix6d covariance = kTogether * (information + 1e-6 * Matrix6d::Identity()).inverse();
  covariance.diagonal().head<3>().array() += kTurnFloor * kTurnFloor;
  covariance.diagonal().tail<3>().array() += kShiftFloor * kShiftFloor;
  return covariance.inverse();
}

double turn_of(const Eigen::Isometry3d& t) { return Eigen::AngleAxisd(t.linear()).angle(); }

}  // namespace

Refine::Refine(gpu::Device& device, const Camera& camera, const Options& options)
    : camera_(camera),
      first_(device, camera, options.surface, options.track.levels, options.track.finest_level),
      second_(device, camera, options.surface, options.track.levels, options.track.finest_level),
      align_(device, options.track) {}

void Refine::add(const Frame& frame, const Eigen::Isometry3d& world_from_camera, const Matrix6d* information) {
  if (!keyframes_.empty()) {
    const Eigen::Isometry3d motion = keyframes_.back().world_from_camera.inverse() * world_from_camera;
    if (motion.translation().norm() < kKeyframeDistance && turn_of(motion) < kKeyframeTurn) return;
  }
  keyframes_.push_back({.frame = frame,
                        .world_from_camera = world_from_camera,
                        .information = information != nullptr ? *information : Matrix6d::Zero(),
                        .features = frame.colour.empty() ? Features{} : describe(frame.colour, frame.depth, camera_),
                        .thumbnail = thumbnail(frame.colour, frame.depth, camera_)});
}

std::vector<Refine::Pair> Refine::pairs() const {
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    std::vector<std::pair<double, std::size_t>> near, alike;
    for (std::size_t j = i + 1; j < keyframes_.size(); ++j) {
      const Eigen::Isometry3d motion = keyframes_[i].world_from_camera.inverse() * keyframes_[j].world_from_camera;
      const double turn = turn_of(motion) / kCovisibleTurn, shift = motion.translation().norm() / kCovisibleDistance;
      if (turn < 1 && shift < 1)
        near.emplace_back(j == i + 1 ? 0.0 : turn + shift, j);
      else
        alike.emplace_back(-similarity(keyframes_[i].thumbnail, keyframes_[j].thumbnail), j);
    }
    std::sort(near.begin(), near.end());
    std::sort(alike.begin(), alike.end());
    for (std::size_t k = 0; k < std::min(near.size(), kCovisible + 1); ++k) {
      const std::size_t j = near[k].second;
      pairs.push_back({i, j, keyframes_[i].world_from_camera.inverse() * keyframes_[j].world_from_camera, false});
    }
    for (std::size_t k = 0; k < std::min(alike.size(), kLookAlikes); ++k) {
      const std::size_t j = alike[k].second;
      const auto located = locate(keyframes_[i].features, keyframes_[j].features, camera_);
      if (located && located->inliers >= kLoopCorners) pairs.push_back({i, j, located->known_from_seen, true});
    }
  }
  return pairs;
}

std::vector<PoseGraph::Edge> Refine::align(const std::vector<Pair>& pairs) {
  std::vector<PoseGraph::Edge> edges;
  const auto fits = [](const Alignment& a) {
    return a.converged() && a.inlier_share > kMinInliers && a.overlap > kMinOverlap && a.rmse < kMaxRmse &&
           a.unobserved == 0;
  };
  // Pairs come in the order of `from`: its surface serves them all.
  std::optional<std::size_t> seen_from;
  ModelView view;
  const auto one_way = [&](std::size_t from, std::size_t to, const Eigen::Isometry3d& guess) {
    if (seen_from != from) view.levels = first_(keyframes_[from].frame).levels;
    seen_from = from;
    return align_(second_(keyframes_[to].frame), view, guess);
  };
  for (const Pair& pair : pairs) {
    const Alignment a = one_way(pair.from, pair.to, pair.from_from_to);
    if (!fits(a)) continue;
    if (pair.is_loop) {
      const Alignment back = one_way(pair.to, pair.from, a.submap_from_camera.inverse());
      const Eigen::Isometry3d round = a.submap_from_camera * back.submap_from_camera;
      if (!fits(back) || round.translation().norm() > kSameDistance || turn_of(round) > kSameTurn) continue;
    }
    // The information is of motions given in the frame of `from`; the graph wants them in that of `to`.
    const Matrix6d from_to = adjoint(a.submap_from_camera);
    edges.push_back({.from = pair.from,
                     .to = pair.to,
                     .from_from_to = a.submap_from_camera,
                     .information = calibrated(from_to.transpose() * a.information * from_to),
                     .may_be_false = true});
  }
  return edges;
}

Refined Refine::operator()(const Trajectory& tracked, const std::filesystem::path& graph_file) {
  Refined refined{.trajectory = tracked};
  if (keyframes_.size() < 2) return refined;
  PoseGraph graph;
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    graph.world_from_node.push_back(keyframes_[k].world_from_camera);
    if (const auto& up = keyframes_[k].frame.acceleration; up && up->norm() > 0)
      graph.gravity.push_back({.node = k, .up = up->normalized(), .sigma = kAccelerometerSigma});
    if (k > 0)
      graph.edges.push_back(
          {.from = k - 1,
           .to = k,
           .from_from_to = keyframes_[k - 1].world_from_camera.inverse() * keyframes_[k].world_from_camera,
           .information = calibrated(keyframes_[k].information)});
  }
  const auto candidates = pairs();
  for (auto& edge : align(candidates)) graph.edges.push_back(std::move(edge));
  const OptimiseReport report = optimise(graph);
  if (!graph_file.empty()) write_g2o(graph_file, graph);

  refined.keyframes = static_cast<int>(keyframes_.size());
  refined.cost_before = report.cost_before, refined.cost = report.cost;
  refined.pairs_tried = static_cast<int>(candidates.size());
  for (std::size_t e = 0; e < graph.edges.size(); ++e) {
    if (!graph.edges[e].may_be_false) continue;
    ++refined.pairs_aligned;
    refined.pairs_believed += report.edge_weights[e] > 0.5;
  }
  // What each keyframe is moved by, in the world.
  std::vector<Eigen::Isometry3d> moves;
  for (std::size_t k = 0; k < keyframes_.size(); ++k)
    moves.push_back(graph.world_from_node[k] * keyframes_[k].world_from_camera.inverse());
  std::size_t next = 0;  // first keyframe that does not come before the frame
  for (StampedPose& pose : refined.trajectory) {
    while (next < keyframes_.size() && keyframes_[next].frame.timestamp < pose.timestamp) ++next;
    Eigen::Isometry3d move = moves[std::min(next, moves.size() - 1)];
    if (next > 0 && next < moves.size()) {
      const double begin = keyframes_[next - 1].frame.timestamp, end = keyframes_[next].frame.timestamp;
      // In the frame of the earlier keyframe's camera, so that the far world does not swing.
      const Eigen::Isometry3d &at = graph.world_from_node[next - 1], &was = keyframes_[next - 1].world_from_camera;
      const Eigen::Isometry3d rest = at.inverse() * moves[next] * was;
      move = at * exponential((pose.timestamp - begin) / (end - begin) * logarithm(rest)) * was.inverse();
    }
    pose.world_from_camera = move * pose.world_from_camera;
    pose.world_from_camera.linear() =
        Eigen::Quaterniond(pose.world_from_camera.linear()).normalized().toRotationMatrix();
  }
  return refined;
}

}  // namespace cairn
