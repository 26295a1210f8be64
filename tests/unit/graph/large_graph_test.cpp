// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include "graph/coarse.hpp"
#include "support/long_walk.hpp"

namespace cairn {
namespace {

PoseGraph tracked(const LongWalk& walk, std::size_t nodes, std::size_t loops) {
  PoseGraph graph;
  while (graph.world_from_node.size() < nodes) walk.add_node(graph);
  return walk.graph(graph.world_from_node, loops);
}

void expect_near(const PoseGraph& graph, const PoseGraph& other, double meters) {
  for (std::size_t k = 0; k < graph.world_from_node.size(); ++k)
    EXPECT_LT((graph.world_from_node[k].translation() - other.world_from_node[k].translation()).norm(), meters) << k;
}

struct Judged {
  int false_ones = 0, lost = 0;  // false loops among the inliers, true loops among the outliers
  Judged(const LongWalk& walk, const std::vector<double>& edge_weights) {
    const std::size_t steps = edge_weights.size() - walk.loops.size();
    for (std::size_t k = 0; k < walk.loops.size(); ++k) {
      const bool accepted = edge_weights[steps + k] > 0;
      false_ones += walk.loops[k].is_false && accepted;
      lost += !walk.loops[k].is_false && !accepted;
    }
  }
};

TEST(LargeGraph, AcceptsTrueLoopsAndRejectsFalseOnes) {
  const LongWalk walk(3000, 270, 30), clean(3000, 270, 0);
  PoseGraph graph = tracked(walk, 3000, walk.loops.size()), without = tracked(clean, 3000, clean.loops.size());
  const OptimizeReport report = optimize(graph);
  const Judged judged(walk, report.edge_weights);
  EXPECT_EQ(judged.false_ones, 0);
  EXPECT_LE(judged.lost, 2);
  optimize(without, {.robust = false});
  EXPECT_LT(walk.error(graph), walk.error(without) + 0.005);
}

TEST(LargeGraph, AcceptsTrueLoopsAndRejectsFalseOnesAtEveryThirdKeyframe) {
  const LongWalk walk(2000, 600, 66);
  PoseGraph graph = tracked(walk, 2000, walk.loops.size());
  const Judged judged(walk, optimize(graph).edge_weights);
  EXPECT_EQ(judged.false_ones, 0);
  EXPECT_LE(judged.lost, 6);
}

TEST(LargeGraph, IsDeterministic) {
  const LongWalk walk(1500, 60, 10);
  PoseGraph first = tracked(walk, 1500, walk.loops.size()), second = first;
  optimize(first);
  optimize(second);
  for (std::size_t k = 0; k < 1500; ++k)
    ASSERT_EQ(first.world_from_node[k].matrix(), second.world_from_node[k].matrix()) << k;
}

/// Adds loops as they arrive, without a full optimization.
TEST(LargeGraph, ClosesLoopsIncrementally) {
  const LongWalk walk(1500, 120, 0);
  PoseGraph grown;
  std::size_t loops = 0;
  while (grown.world_from_node.size() < walk.truth.size()) {
    walk.add_node(grown);
    for (; loops < walk.loops.size() && walk.loops[loops].edge.j < grown.world_from_node.size(); ++loops) {
      PoseGraph graph = walk.graph(grown.world_from_node, loops + 1);
      const OptimizeReport report = close_loop(graph, std::vector<double>(graph.edges.size(), 1.0));
      EXPECT_EQ(report.edge_weights.back(), 1.0) << loops;
      grown.world_from_node = graph.world_from_node;
    }
  }
  PoseGraph full = tracked(walk, 1500, walk.loops.size());
  const double drift = walk.error(full);
  optimize(full);
  // close_loop() moves every eighth node, and other loops move these nodes as well: up to a tenth more drift remains.
  EXPECT_GT(drift, 1.5 * walk.error(full));
  EXPECT_LT(walk.error(walk.graph(grown.world_from_node, loops)), walk.error(full) + 0.1 * drift);
}

TEST(LargeGraph, RejectsALoopContradictedByOthers) {
  const LongWalk walk(1500, 120, 0);
  PoseGraph graph = tracked(walk, 1500, walk.loops.size());
  optimize(graph);
  PoseGraph::Edge false_edge = walk.loops[60].edge;
  false_edge.i_from_j = false_edge.i_from_j * Eigen::Translation3d(2, 0, 0);
  graph.edges.push_back(false_edge);
  const PoseGraph before = graph;
  const OptimizeReport report = close_loop(graph, std::vector<double>(graph.edges.size(), 1.0));
  EXPECT_EQ(report.edge_weights.back(), 0.0);
  expect_near(graph, before, 1e-12);
}

/// State after the result of a full optimization is applied and newer keyframes are attached.
TEST(LargeGraph, AppliesOtherLoopsIfTheLastIsRejected) {
  const LongWalk walk(1500, 120, 0);
  PoseGraph graph = tracked(walk, 1500, walk.loops.size());
  optimize(graph);
  for (std::size_t k = 1400; k < 1500; ++k)
    graph.world_from_node[k].pretranslate(Eigen::Vector3d(0.002 * static_cast<double>(k - 1400), 0, 0));
  PoseGraph without = graph;
  close_loop(without, std::vector<double>(without.edges.size(), 1.0));
  PoseGraph::Edge false_edge = walk.loops[60].edge;
  false_edge.i_from_j = false_edge.i_from_j * Eigen::Translation3d(2, 0, 0);
  graph.edges.push_back(false_edge);
  std::vector<double> weights(graph.edges.size(), 1.0);
  weights.back() = 0;
  const OptimizeReport report = close_loop(graph, weights);
  EXPECT_EQ(report.edge_weights.back(), 0.0);
  expect_near(graph, without, 1e-9);
}

/// Coarsening keeps the relative pose of a chain's ends and gravity.
TEST(CoarseGraph, KeepsChainEndsAndConnectingEdges) {
  const LongWalk walk(300, 3, 0);
  PoseGraph fine = tracked(walk, 300, 3);
  // A break: two components, joined only by a loop.
  std::erase_if(fine.edges, [](const auto& e) { return e.i == 99 && e.j == 100; });
  fine.edges.push_back({.i = 40,
                        .j = 101,
                        .i_from_j = fine.world_from_node[40].inverse() * fine.world_from_node[101],
                        .is_loop_closure = true});
  const Eigen::Vector3d up(0, -1, 0);
  fine.gravity.push_back({.node = 102, .up = fine.world_from_node[102].linear().transpose() * up, .sigma = 0.1});
  fine.gravity.push_back({.node = 103, .up = fine.world_from_node[103].linear().transpose() * up, .sigma = 0.1});
  const CoarseGraph coarse(fine, 8);
  EXPECT_LT(coarse.graph.world_from_node.size(), 300 / 8 + 6);
  // Steps agree with the poses computed from them, so only the walk's loops have errors.
  for (const auto& e : coarse.graph.edges) {
    if (e.is_loop_closure) continue;
    const Eigen::Isometry3d placed = coarse.graph.world_from_node[e.i].inverse() * coarse.graph.world_from_node[e.j];
    EXPECT_LT(local_coordinates(placed.inverse() * e.i_from_j).norm(), 1e-9);
  }
  const auto& joint = coarse.graph.edges[coarse.edge_of.back()];
  EXPECT_LT(local_coordinates((coarse.graph.world_from_node[joint.i] * joint.i_from_j).inverse() *
                              coarse.graph.world_from_node[joint.j])
                .norm(),
            1e-9);
  ASSERT_EQ(coarse.graph.gravity.size(), 1u);
  const auto& g = coarse.graph.gravity[0];
  EXPECT_LT((coarse.graph.world_from_node[g.node].linear() * g.up - up).norm(), 1e-9);
  EXPECT_NEAR(g.sigma, 0.1 / std::sqrt(2), 1e-9);
  PoseGraph interpolate = fine;
  interpolate.world_from_node = coarse.interpolate(fine);
  expect_near(interpolate, fine, 1e-9);
}

TEST(CoarseGraph, InterpolatesBetweenKeptNodes) {
  const LongWalk walk(17, 0, 0);
  const PoseGraph fine = tracked(walk, 17, 0);
  CoarseGraph coarse(fine, 8);
  const Eigen::Vector3d shift(0.1, 0, 0);
  coarse.graph.world_from_node.back().pretranslate(shift);
  const auto poses = coarse.interpolate(fine);
  EXPECT_LT((poses[8].translation() - fine.world_from_node[8].translation()).norm(), 1e-9);
  EXPECT_LT((poses[12].translation() - fine.world_from_node[12].translation() - shift / 2).norm(), 1e-9);
  EXPECT_LT((poses[16].translation() - fine.world_from_node[16].translation() - shift).norm(), 1e-9);
}

}  // namespace
}  // namespace cairn
