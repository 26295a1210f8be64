// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/settling.hpp"

#include <malloc.h>

#include <algorithm>

namespace cairn {
namespace {

constexpr std::size_t kGrowth = 20;  // the whole graph is optimized again after it has grown by 1/kGrowth
constexpr std::size_t kLater = 100;  // the result is taken after the graph has grown by 1/kLater

BegunGraph all_of(const Atlas& atlas) { return {atlas.keyframes.size(), atlas.loops.size(), atlas.world_from_camera}; }

}  // namespace

Settling::Memory Settling::memory() const {
  return {.unsettled = unsettled_, .closing = closing_.valid(), .whole = begun_, .next_whole = next_whole_};
}

void Settling::restore(const Memory& memory, const Atlas& atlas) {
  next_whole_ = std::max(memory.next_whole, kLargeGraph);
  unsettled_ = memory.unsettled;
  if (memory.whole) begin_whole(atlas, *memory.whole);
  // The same graph: keyframes and loop closures are added after its result.
  if (memory.closing) begin_closing(atlas);
}

void Settling::begin(const Atlas& atlas) {
  begin_closing(atlas);
  if (atlas.keyframes.size() < kLargeGraph) {
    unsettled_ = false;
  } else if (!whole_.valid() && atlas.keyframes.size() >= next_whole_) {
    unsettled_ = false;
    next_whole_ = atlas.keyframes.size() + atlas.keyframes.size() / kGrowth;
    begin_whole(atlas, all_of(atlas));
  }
}

void Settling::begin_closing(const Atlas& atlas) {
  closing_ = std::async(std::launch::async, [graph = atlas.graph(), weights = atlas.edge_weights()]() mutable {
    const OptimiseReport report =
        graph.world_from_node.size() < kLargeGraph ? optimise(graph) : close_loop(graph, weights);
    return Result(std::move(graph), report);
  });
}

void Settling::begin_whole(const Atlas& atlas, BegunGraph begun) {
  PoseGraph graph = atlas.graph(begun.keyframes, begun.loops);
  graph.world_from_node = begun.world_from_camera;
  begun_ = std::move(begun);
  whole_ = std::async(std::launch::async, [graph = std::move(graph)]() mutable {
    const OptimiseReport report = optimise(graph);
    malloc_trim(0);  // the solver allocated some KB per keyframe
    return Result(std::move(graph), report);
  });
}

void Settling::take(Atlas& atlas, std::future<Result>& result) {
  if (!result.valid()) return;
  const auto [graph, report] = result.get();
  atlas.take(graph, report);
  longest_ = std::max(longest_, report.seconds);
}

bool Settling::take(Atlas& atlas) {
  take_closing(atlas);
  if (!begun_ || atlas.keyframes.size() < begun_->keyframes + begun_->keyframes / kLater) return false;
  take_whole(atlas);
  return unsettled_;
}

void Settling::take_whole(Atlas& atlas) {
  begun_.reset();
  take(atlas, whole_);
}

void Settling::finish(Atlas& atlas) {
  take_whole(atlas);
  if (!std::exchange(unsettled_, false)) return;
  begin_whole(atlas, all_of(atlas));
  take_whole(atlas);
}

}  // namespace cairn
