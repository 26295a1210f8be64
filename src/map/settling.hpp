// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Schedule of pose graph optimizations concurrent with tracking.
#pragma once
#include <future>
#include <optional>
#include <utility>
#include <vector>

#include "map/atlas.hpp"

namespace cairn {

/// Initial state of an optimization of the whole graph.
struct BegunGraph {
  std::size_t keyframes = 0, loops = 0;
  std::vector<Eigen::Isometry3d> world_from_camera;  // by keyframe
};

/// Schedules optimizations. A small graph is optimized as a whole after each loop closure that reveals a slip; the
/// poses are taken at the next keyframe. In a graph of at least kLargeGraph keyframes only the loop is closed
/// (close_loop()). The whole graph is optimized after each growth by a twentieth, and the result is taken a hundredth
/// of its keyframes later. Results are always taken at these points, for any duration of the optimization, so that
/// offline runs are repeatable. Exceptions of an optimization are rethrown where its result is taken.
class Settling {
 public:
  struct Memory {
    bool unsettled = false, closing = false;
    std::optional<BegunGraph> whole;
    std::size_t next_whole = 0;
  };
  [[nodiscard]] Memory memory() const;
  /// Restarts the same optimizations.
  void restore(const Memory& memory, const Atlas& atlas);

  /// Records a new loop closure.
  void add_loop() { unsettled_ = true; }
  /// Starts an optimization after a loop closure with slip, the last one of the atlas.
  void begin(const Atlas& atlas);
  /// Takes the results due at a new keyframe. Returns true if some loop closures are not in them, so that begin() is
  /// due.
  [[nodiscard]] bool take(Atlas& atlas);
  /// Waits for the running loop closing and takes its result.
  void take_closing(Atlas& atlas) { take(atlas, closing_); }
  /// Waits for the running optimization of the whole graph, and repeats it if later loop closures were added.
  void finish(Atlas& atlas);
  /// Duration of the longest optimization so far, seconds.
  [[nodiscard]] double longest_seconds() const { return longest_; }

 private:
  using Result = std::pair<PoseGraph, OptimiseReport>;
  void begin_closing(const Atlas& atlas);
  void begin_whole(const Atlas& atlas, BegunGraph begun);
  void take_whole(Atlas& atlas);
  void take(Atlas& atlas, std::future<Result>& result);

  bool unsettled_ = false;
  std::size_t next_whole_ = kLargeGraph;  // keyframes
  std::future<Result> closing_, whole_;   // taken at the next keyframe; taken later
  std::optional<BegunGraph> begun_;       // of whole_
  double longest_ = 0;
};

}  // namespace cairn
