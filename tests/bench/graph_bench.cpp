// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <benchmark/benchmark.h>

#include <ctime>

#include "support/long_walk.hpp"

namespace cairn {
namespace {

/// Walk of N keyframes with a loop at every tenth, one in ten of them false. Adds each loop as it arrives, optimizes
/// the graph after each growth by a twentieth, as a mapper does, and at the end. CPU seconds, to exclude other
/// programs.
void close_loops_of_a_long_walk(benchmark::State& state) {
  const auto nodes = static_cast<std::size_t>(state.range(0));
  const LongWalk walk(nodes, nodes * 9 / 100, nodes / 100);
  for (auto _ : state) {
    PoseGraph grown;
    std::vector<double> inlier_weights, seconds;
    std::size_t next_full = kLargeGraph;
    double longest_full = 0;
    const auto now = [] { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; };
    const auto optimize_all = [&] {
      PoseGraph graph = walk.graph(grown.world_from_node, inlier_weights.size());
      const double begin = now();
      const OptimizeReport report = optimize(graph);
      longest_full = std::max(longest_full, now() - begin);
      std::copy_n(report.edge_weights.end() - static_cast<std::ptrdiff_t>(inlier_weights.size()), inlier_weights.size(),
                  inlier_weights.begin());
      grown.world_from_node = graph.world_from_node;
    };
    while (grown.world_from_node.size() < nodes) {
      walk.add_node(grown);
      while (inlier_weights.size() < walk.loops.size() &&
             walk.loops[inlier_weights.size()].edge.j < grown.world_from_node.size()) {
        inlier_weights.push_back(1);
        PoseGraph graph = walk.graph(grown.world_from_node, inlier_weights.size());
        std::vector<double> weights(graph.edges.size(), 1.0);
        std::copy(inlier_weights.rbegin(), inlier_weights.rend(), weights.rbegin());
        const double begin = now();
        const OptimizeReport report = close_loop(graph, weights);
        seconds.push_back(now() - begin);
        inlier_weights.back() = report.edge_weights.back();
        grown.world_from_node = graph.world_from_node;
      }
      if (grown.world_from_node.size() < next_full) continue;
      optimize_all();
      next_full = next_full * 21 / 20;
    }
    optimize_all();
    std::sort(seconds.begin(), seconds.end());
    double false_ones = 0, lost = 0;
    for (std::size_t k = 0; k < inlier_weights.size(); ++k) {
      false_ones += walk.loops[k].is_false && inlier_weights[k] > 0;
      lost += !walk.loops[k].is_false && inlier_weights[k] == 0;
    }
    state.counters["median_ms"] = 1e3 * seconds[seconds.size() / 2];
    state.counters["longest_ms"] = 1e3 * seconds.back();
    state.counters["whole_s"] = longest_full;
    state.counters["false"] = false_ones;
    state.counters["lost"] = lost;
  }
}

BENCHMARK(close_loops_of_a_long_walk)->Arg(20000)->Iterations(1)->Unit(benchmark::kSecond)->UseRealTime();

}  // namespace
}  // namespace cairn
