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
    std::vector<double> believed, seconds;
    std::size_t next_whole = kLargeGraph;
    double longest_whole = 0;
    const auto now = [] { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; };
    const auto settle = [&] {
      PoseGraph graph = walk.graph(grown.world_from_node, believed.size());
      const double begin = now();
      const OptimiseReport report = optimise(graph);
      longest_whole = std::max(longest_whole, now() - begin);
      std::copy_n(report.edge_weights.end() - static_cast<std::ptrdiff_t>(believed.size()), believed.size(),
                  believed.begin());
      grown.world_from_node = graph.world_from_node;
    };
    while (grown.world_from_node.size() < nodes) {
      walk.add_node(grown);
      while (believed.size() < walk.loops.size() && walk.loops[believed.size()].edge.j < grown.world_from_node.size()) {
        believed.push_back(1);
        PoseGraph graph = walk.graph(grown.world_from_node, believed.size());
        std::vector<double> weights(graph.edges.size(), 1.0);
        std::copy(believed.rbegin(), believed.rend(), weights.rbegin());
        const double begin = now();
        const OptimiseReport report = close_loop(graph, weights);
        seconds.push_back(now() - begin);
        believed.back() = report.edge_weights.back();
        grown.world_from_node = graph.world_from_node;
      }
      if (grown.world_from_node.size() < next_whole) continue;
      settle();
      next_whole = next_whole * 21 / 20;
    }
    settle();
    std::sort(seconds.begin(), seconds.end());
    double false_ones = 0, lost = 0;
    for (std::size_t k = 0; k < believed.size(); ++k) {
      false_ones += walk.loops[k].is_false && believed[k] > 0;
      lost += !walk.loops[k].is_false && believed[k] == 0;
    }
    state.counters["median_ms"] = 1e3 * seconds[seconds.size() / 2];
    state.counters["longest_ms"] = 1e3 * seconds.back();
    state.counters["whole_s"] = longest_whole;
    state.counters["false"] = false_ones;
    state.counters["lost"] = lost;
  }
}

BENCHMARK(close_loops_of_a_long_walk)->Arg(20000)->Iterations(1)->Unit(benchmark::kSecond)->UseRealTime();

}  // namespace
}  // namespace cairn
