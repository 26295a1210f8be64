// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Schedule of pose graph optimizations concurrent with tracking.
#pragma once
#include <future>
#include <optional>
#include <vector>

#include "map/atlas.hpp"

namespace cairn {

/// Initial state of an optimization of the whole graph.
struct GraphSnapshot {
  std::size_t keyframes = 0, loops = 0;
  std::vector<Eigen::Isometry3d> world_from_camera;  // by keyframe
};

/// Schedules optimizations. A small graph is optimized as a whole after each loop closure that reveals drift; the
/// poses are taken at the next keyframe. In a graph of at least kLargeGraph keyframes only the loop is closed
/// (close_loop()). Each time the graph has grown by 5 %, the whole graph is optimized in the background; the result is
/// applied after another 1 %. Results are always taken at these points, for any duration of the optimization, so that
/// offline runs are repeatable. Exceptions of an optimization are rethrown where its result is taken.
class GraphScheduler {
 public:
  struct State {
    bool has_pending_loops = false, closing = false;
    std::optional<GraphSnapshot> full;
    std::size_t next_full = 0;
  };
  [[nodiscard]] State save() const;
  /// Restarts the same optimizations.
  void restore(const State& state, const Atlas& atlas);

  /// Records a new loop closure.
  void add_loop() { has_pending_loops_ = true; }
  /// Starts an optimization after a loop closure that reveals drift, the last one of the atlas.
  void start(const Atlas& atlas);
  /// Takes the results due at a new keyframe. Returns true if some loop closures are not in them, so that start() is
  /// due.
  [[nodiscard]] bool take_results(Atlas& atlas);
  /// Waits for the running loop closing and takes its result.
  void take_closing(Atlas& atlas) { take_result(atlas, closing_result_); }
  /// Waits for the running optimization of the whole graph, and repeats it if later loop closures were added.
  void finish(Atlas& atlas);
  /// Duration of the longest optimization so far, seconds.
  [[nodiscard]] double longest_seconds() const { return longest_; }

 private:
  struct Result {
    PoseGraph graph;
    OptimizeReport report;
    std::optional<InertialGraph> inertial;
  };
  void start_closing(const Atlas& atlas);
  void start_full(const Atlas& atlas, GraphSnapshot snapshot);
  void take_full(Atlas& atlas);
  void take_result(Atlas& atlas, std::future<Result>& result);

  bool has_pending_loops_ = false;
  std::size_t next_full_ = kLargeGraph;               // keyframes
  std::future<Result> closing_result_, full_result_;  // taken at the next keyframe; taken later
  std::optional<GraphSnapshot> full_start_;           // of full_result_
  double longest_ = 0;
};

}  // namespace cairn
