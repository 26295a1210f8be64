// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "graph/consistency.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>

#include "graph/way.hpp"

namespace cairn {
namespace {

constexpr std::size_t kNeighbours = 5;               // max. nodes between the ends of neighboring edges
constexpr double kFewAlone = 10, kShareAlone = 0.1;  // tolerated isolated loop closures; share of agreeing ones

/// Relative pose from node `a` to node `b` along steps_of() their graph; empty if a step is missing.
std::optional<Way> along(const std::vector<const PoseGraph::Edge*>& step, std::size_t a, std::size_t b) {
  Way way{Eigen::Isometry3d::Identity(), Matrix6d::Zero()};
  for (std::size_t i = std::min(a, b); i < std::max(a, b); ++i) {
    if (step[i] == nullptr) return std::nullopt;
    way = then(way, along(*step[i]));
  }
  return a <= b ? way : reverse(way);
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
    const Way loop = along(e);
    for (std::size_t i = e.i - std::min(e.i, kNeighbours); i <= std::min(e.i + kNeighbours, nodes - 1); ++i)
      for (const std::size_t other : from[i]) {
        const auto& o = graph.edges[other];
        if (other == k || (found[k] == Consistency::agrees && found[other] == Consistency::agrees)) continue;
        if (std::max(o.j, e.j) - std::min(o.j, e.j) > kNeighbours) continue;
        const auto there = along(step, e.i, o.i), back = along(step, o.j, e.j);
        if (!there || !back) continue;
        // Round trip: along the other edge, then back along this one.
        const Way around = then(then(then(*there, along(o)), *back), reverse(loop));
        const Vector6d error = local_coordinates(around.pose);
        const bool agree = error.dot(around.covariance.ldlt().solve(error)) < limit;
        for (const std::size_t edge : {k, other})
          if (found[edge] != Consistency::agrees) found[edge] = agree ? Consistency::agrees : Consistency::contradicts;
      }
  }
  return found;
}

}  // namespace

std::vector<double> first_weights(const PoseGraph& graph, double limit) {
  std::vector<double> weights(graph.edges.size(), 1.0);
  const std::vector<Consistency> found = pairwise_consistency(graph, limit);
  const auto agreeing = static_cast<double>(std::count(found.begin(), found.end(), Consistency::agrees));
  double alone = 0;
  for (std::size_t k = 0; k < weights.size(); ++k)
    alone += graph.edges[k].is_loop_closure && found[k] == Consistency::none;
  const bool too_many_alone = alone > kFewAlone + kShareAlone * agreeing;
  for (std::size_t k = 0; k < weights.size(); ++k)
    if (graph.edges[k].is_loop_closure &&
        (found[k] == Consistency::contradicts || (found[k] == Consistency::none && too_many_alone)))
      weights[k] = 0;
  return weights;
}

}  // namespace cairn
