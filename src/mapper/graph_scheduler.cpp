// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/graph_scheduler.hpp"

#include <malloc.h>

#include <algorithm>
#include <utility>

namespace cairn {
namespace {

constexpr std::size_t kGrowthDivisor = 20;  // the whole graph is optimized again after it has grown by 1/kGrowthDivisor
constexpr std::size_t kDelayDivisor = 100;  // the result is taken after the graph has grown by 1/kDelayDivisor

GraphSnapshot all_of(const Atlas& atlas) {
  return {atlas.keyframes.size(), atlas.loops.size(), atlas.world_from_camera};
}

}  // namespace

GraphScheduler::State GraphScheduler::save() const {
  return {.has_pending_loops = has_pending_loops_,
          .closing = closing_result_.valid(),
          .full = full_start_,
          .next_full = next_full_};
}

void GraphScheduler::restore(const State& state, const Atlas& atlas) {
  next_full_ = std::max(state.next_full, kLargeGraph);
  has_pending_loops_ = state.has_pending_loops;
  if (state.full) start_full(atlas, *state.full);
  // The same graph: keyframes and loop closures are added after its result.
  if (state.closing) start_closing(atlas);
}

void GraphScheduler::start(const Atlas& atlas) {
  start_closing(atlas);
  if (atlas.keyframes.size() < kLargeGraph) {
    has_pending_loops_ = false;
  } else if (!full_result_.valid() && atlas.keyframes.size() >= next_full_) {
    has_pending_loops_ = false;
    next_full_ = atlas.keyframes.size() + atlas.keyframes.size() / kGrowthDivisor;
    start_full(atlas, all_of(atlas));
  }
}

void GraphScheduler::start_closing(const Atlas& atlas) {
  Result result{.graph = atlas.graph(), .report = {}, .inertial = {}};
  if (atlas.keyframes.size() < kLargeGraph) result.inertial = atlas.inertial_graph(atlas.keyframes.size());
  closing_result_ =
      std::async(std::launch::async, [result = std::move(result), weights = atlas.edge_weights()]() mutable {
        if (result.graph.world_from_node.size() < kLargeGraph)
          result.report = optimize(result.graph, result.inertial ? &*result.inertial : nullptr);
        else
          result.report = close_loop(result.graph, weights);
        return std::move(result);
      });
}

void GraphScheduler::start_full(const Atlas& atlas, GraphSnapshot snapshot) {
  Result result{.graph = atlas.graph(snapshot.keyframes, snapshot.loops),
                .report = {},
                .inertial = atlas.inertial_graph(snapshot.keyframes)};
  result.graph.world_from_node = snapshot.world_from_camera;
  full_start_ = std::move(snapshot);
  full_result_ = std::async(std::launch::async, [result = std::move(result)]() mutable {
    result.report = optimize(result.graph, result.inertial ? &*result.inertial : nullptr);
    malloc_trim(0);  // the solver allocated some KB per keyframe
    return std::move(result);
  });
}

void GraphScheduler::take_result(Atlas& atlas, std::future<Result>& result) {
  if (!result.valid()) return;
  const auto [graph, report, inertial] = result.get();
  atlas.update_poses(graph, report, inertial);
  longest_ = std::max(longest_, report.seconds);
}

bool GraphScheduler::take_results(Atlas& atlas) {
  take_closing(atlas);
  if (!full_start_ || atlas.keyframes.size() < full_start_->keyframes + full_start_->keyframes / kDelayDivisor)
    return false;
  take_full(atlas);
  return has_pending_loops_;
}

void GraphScheduler::take_full(Atlas& atlas) {
  full_start_.reset();
  take_result(atlas, full_result_);
}

void GraphScheduler::finish(Atlas& atlas) {
  take_full(atlas);
  if (!std::exchange(has_pending_loops_, false)) return;
  start_full(atlas, all_of(atlas));
  take_full(atlas);
}

}  // namespace cairn
