// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// When the pose graph is optimised, beside tracking, and when what comes of it is taken.
#pragma once
#include <future>
#include <optional>
#include <utility>
#include <vector>

#include "map/atlas.hpp"

namespace cairn {

/// What an optimisation of the whole began with.
struct BegunGraph {
  std::size_t keyframes = 0, loops = 0;
  std::vector<Eigen::Isometry3d> world_from_camera;  // of the keyframes
};

/// A small graph is optimised as a whole whenever a loop tells that the camera had slipped, and the poses are taken at
/// the next keyframe. In one of kLargeGraph keyframes and more the loop alone is closed (close_loop()); the whole is
/// optimised when it has grown by a twentieth, and taken a hundredth of its keyframes later. Both are always taken
/// then, however long they take, so that offline runs repeat. What an optimisation throws is thrown where it is taken.
class Settling {
 public:
  struct Memory {
    bool unsettled = false, closing = false;
    std::optional<BegunGraph> whole;
    std::size_t next_whole = 0;
  };
  [[nodiscard]] Memory memory() const;
  /// The same optimisations run again.
  void restore(const Memory& memory, const Atlas& atlas);

  /// A loop came.
  void add_loop() { unsettled_ = true; }
  /// Begins, after one that has slipped: the last one of the atlas.
  void begin(const Atlas& atlas);
  /// Takes what is due at a new keyframe. Returns whether there are loops that it does not know, so that begin() is
  /// due.
  [[nodiscard]] bool take(Atlas& atlas);
  /// Waits for the loop at work and takes it.
  void take_closing(Atlas& atlas) { take(atlas, closing_); }
  /// Waits for the whole at work, and optimises it once more if loops came that no optimisation of it has seen.
  void finish(Atlas& atlas);
  /// Of the longest optimisation that was taken.
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
