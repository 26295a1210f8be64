// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "graph/coarse.hpp"

#include <algorithm>

#include "graph/relative_pose.hpp"

namespace cairn {
namespace {

/// Combines the gravity readings of a node.
void add_gravity(std::vector<PoseGraph::Gravity>& gravity, std::vector<std::size_t>& of_node,
                 const PoseGraph::Gravity& reading) {
  if (of_node[reading.node] == CoarseGraph::kNone) {
    of_node[reading.node] = gravity.size();
    gravity.push_back(reading);
    return;
  }
  auto& all = gravity[of_node[reading.node]];
  const double before = 1 / (all.sigma * all.sigma), weight = 1 / (reading.sigma * reading.sigma);
  all.up = (before * all.up + weight * reading.up).normalized();
  all.sigma = 1 / std::sqrt(before + weight);
}

/// Nearest kept node of a node.
struct NearestKept {
  std::size_t node = 0;  // in CoarseGraph::graph
  RelativePose from;     // from the kept node to this node
};

}  // namespace

CoarseGraph::CoarseGraph(const PoseGraph& fine, std::size_t spacing) : edge_of(fine.edges.size(), kNone) {
  const std::size_t nodes = fine.world_from_node.size();
  const std::vector<const PoseGraph::Edge*> step = steps_of(fine);
  places_.resize(nodes);
  std::vector<NearestKept> next(nodes);
  const auto keep = [&](std::size_t node) {
    kept_.push_back(node);
    graph.world_from_node.push_back(fine.world_from_node[node]);
    return kept_.size() - 1;
  };
  for (std::size_t begin = 0; begin < nodes;) {
    std::size_t from = keep(begin);
    next[begin] = {from, {}};
    places_[begin] = {from, from, 0};
    while (step[begin] != nullptr) {
      // From one kept node to the next.
      std::size_t end = begin + 1;
      while (end - begin < spacing && step[end] != nullptr) ++end;
      std::vector<RelativePose> steps,
          poses_from_start{RelativePose{}};  // of this segment; from the kept node to the end of each step
      for (std::size_t i = begin; i < end; ++i) {
        steps.push_back(along(*step[i]));
        poses_from_start.push_back(compose(poses_from_start.back(), steps.back()));
      }
      const std::size_t to = keep(end);
      const std::size_t count = end - begin;
      RelativePose back;  // from the end
      for (std::size_t i = end; i > begin; --i) {
        const std::size_t at = i - begin;
        places_[i] = {from, to, static_cast<double>(at) / static_cast<double>(count)};
        next[i] = 2 * at < count ? NearestKept{from, poses_from_start[at]} : NearestKept{to, back};
        if (2 * at >= count) back = compose(back, inverse(steps[at - 1]));
        edge_of[static_cast<std::size_t>(step[i - 1] - fine.edges.data())] = graph.edges.size();
      }
      graph.edges.push_back({.i = from,
                             .j = to,
                             .i_from_j = poses_from_start.back().pose,
                             .information = poses_from_start.back().covariance.inverse()});
      begin = end, from = to;
    }
    ++begin;
  }
  for (std::size_t k = 0; k < fine.edges.size(); ++k) {
    const auto& e = fine.edges[k];
    if (step[e.i] == &e) continue;
    const NearestKept &i = next[e.i], &j = next[e.j];
    if (i.node == j.node) continue;
    const RelativePose relative_pose = compose(compose(i.from, along(e)), inverse(j.from));
    edge_of[k] = graph.edges.size();
    graph.edges.push_back({.i = i.node,
                           .j = j.node,
                           .i_from_j = relative_pose.pose,
                           .information = relative_pose.covariance.inverse(),
                           .is_loop_closure = e.is_loop_closure});
  }
  std::vector<std::size_t> of_node(kept_.size(), kNone);
  for (const auto& g : fine.gravity)
    add_gravity(graph.gravity, of_node,
                {.node = next[g.node].node, .up = next[g.node].from.pose.linear() * g.up, .sigma = g.sigma});
}

std::vector<Eigen::Isometry3d> CoarseGraph::interpolate(const PoseGraph& fine) const {
  std::vector<Eigen::Isometry3d> poses;
  poses.reserve(places_.size());
  const auto moved_with = [&](std::size_t coarse, std::size_t node) {
    return Eigen::Isometry3d(graph.world_from_node[coarse] * fine.world_from_node[kept_[coarse]].inverse() *
                             fine.world_from_node[node]);
  };
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const Place& place = places_[i];
    Eigen::Isometry3d pose = moved_with(place.before, i);
    pose = pose * retract(place.share * local_coordinates(pose.inverse() * moved_with(place.after, i)));
    // Prevents the growth of rounding errors, which would double each time.
    pose.linear() = Eigen::Quaterniond(pose.linear()).normalized().toRotationMatrix();
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace cairn
