// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "graph/consistency.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>

#include "graph/relative_pose.hpp"

namespace cairn {
namespace {

constexpr std::size_t kNeighborRange = 5;  // max. nodes between the ends of neighboring edges
// Tolerated isolated loop closures; share of agreeing ones.
constexpr double kMaxIsolated = 10, kMaxIsolatedShare = 0.1;

/// Relative pose from node `a` to node `b` along steps_of() their graph; empty if a step is missing.
std::optional<RelativePose> along(const std::vector<const PoseGraph::Edge*>& step, std::size_t a, std::size_t b) {
  RelativePose relative_pose{Eigen::Isometry3d::Identity(), Matrix6d::Zero()};
  for (std::size_t i = std::min(a, b); i < std::max(a, b); ++i) {
    if (step[i] == nullptr) return std::nullopt;
    relative_pose = compose(relative_pose, along(*step[i]));
  }
  return a <= b ? relative_pose : inverse(relative_pose);
}

/// Pairwise consistency of loop closures (Mangelson et al. 2018). agrees: a neighboring loop closure, with both ends
/// nearby, agrees within the noise of both and of the steps between their ends. contradicts: has neighbors, and none
/// agrees.
enum class Consistency : std::uint8_t { none, agrees, contradicts };
std::vector<Consistency> pairwise_consistency(const PoseGraph& graph, double limit) {
  std::vector<Consistency> found(graph.edges.size(), Consistency::none);
  const std::size_t nodes = graph.world_from_node.size();
  const std::vector<const PoseGraph::Edge*> step = steps_of(graph);
  std::vector<std::vector<std::size_t>> from(nodes);
  for (std::size_t k = 0; k < graph.edges.size(); ++k)
    if (graph.edges[k].is_loop_closure) from[graph.edges[k].i].push_back(k);
  for (std::size_t k = 0; k < graph.edges.size(); ++k) {
    const auto& e = graph.edges[k];
    if (!e.is_loop_closure) continue;
    const RelativePose loop = along(e);
    for (std::size_t i = e.i - std::min(e.i, kNeighborRange); i <= std::min(e.i + kNeighborRange, nodes - 1); ++i)
      for (const std::size_t other : from[i]) {
        const auto& o = graph.edges[other];
        if (other == k || (found[k] == Consistency::agrees && found[other] == Consistency::agrees)) continue;
        if (std::max(o.j, e.j) - std::min(o.j, e.j) > kNeighborRange) continue;
        const auto start_offset = along(step, e.i, o.i), end_offset = along(step, o.j, e.j);
        if (!start_offset || !end_offset) continue;
        // Round trip: along the other edge, then back along this one.
        const RelativePose round_trip = compose(compose(compose(*start_offset, along(o)), *end_offset), inverse(loop));
        const Vector6d error = local_coordinates(round_trip.pose);
        const bool agree = error.dot(round_trip.covariance.ldlt().solve(error)) < limit;
        for (const std::size_t edge : {k, other})
          if (found[edge] != Consistency::agrees) found[edge] = agree ? Consistency::agrees : Consistency::contradicts;
      }
  }
  return found;
}

}  // namespace

std::vector<double> initial_weights(const PoseGraph& graph, double limit) {
  std::vector<double> weights(graph.edges.size(), 1.0);
  const std::vector<Consistency> found = pairwise_consistency(graph, limit);
  const auto agreeing = static_cast<double>(std::count(found.begin(), found.end(), Consistency::agrees));
  double isolated = 0;
  for (std::size_t k = 0; k < weights.size(); ++k)
    isolated += graph.edges[k].is_loop_closure && found[k] == Consistency::none;
  const bool too_many_isolated = isolated > kMaxIsolated + kMaxIsolatedShare * agreeing;
  for (std::size_t k = 0; k < weights.size(); ++k)
    if (graph.edges[k].is_loop_closure &&
        (found[k] == Consistency::contradicts || (found[k] == Consistency::none && too_many_isolated)))
      weights[k] = 0;
  return weights;
}

}  // namespace cairn
