// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/graph_scheduler.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "support/long_walk.hpp"

namespace cairn {
namespace {

/// Pose graph of a mapper during a long walk.
class Walker {
 public:
  explicit Walker(std::size_t loops) : walk_(1200, loops, 0) {}

  void go_to(std::size_t keyframes) {
    while (atlas.keyframes.size() < keyframes) step();
  }
  /// Saves and restores the state, as a resumed session.
  void resume() {
    const GraphScheduler::State state = scheduler_->save();
    scheduler_ = std::make_unique<GraphScheduler>();
    scheduler_->restore(state, atlas);
  }
  void finish() {
    scheduler_->take_closing(atlas);
    scheduler_->finish(atlas);
  }
  [[nodiscard]] GraphScheduler::State saved() const { return scheduler_->save(); }
  [[nodiscard]] bool accepts_all_loops() const {
    return std::all_of(atlas.loops.begin(), atlas.loops.end(), [](const Loop& l) { return l.inlier; });
  }

  Atlas atlas;
  std::vector<std::size_t> full_results_taken;  // number of keyframes at each application

 private:
  void step() {
    const bool runs = scheduler_->save().full.has_value();
    bool is_due = scheduler_->take_results(atlas);
    if (runs && !scheduler_->save().full) full_results_taken.push_back(atlas.keyframes.size());
    walk_.add_node(tracked_);
    const std::size_t k = atlas.keyframes.size();
    const Matrix6d information =
        k > 0 ? walk_.graph(tracked_.world_from_node, 0).edges.back().information : Matrix6d::Zero();
    atlas.add({.frame = static_cast<int>(k),
               .follows = k > 0,
               .odometry_from_camera = tracked_.world_from_node[k],
               .submap_from_camera = tracked_.world_from_node[k],
               .information = information});
    for (; atlas.loops.size() < walk_.loops.size() && walk_.loops[atlas.loops.size()].edge.j == k; is_due = true) {
      atlas.loops.push_back({.edge = walk_.loops[atlas.loops.size()].edge});
      scheduler_->add_loop();
    }
    if (is_due) scheduler_->start(atlas);
  }

  LongWalk walk_;
  PoseGraph tracked_;
  std::unique_ptr<GraphScheduler> scheduler_ = std::make_unique<GraphScheduler>();
};

TEST(GraphScheduler, OptimizesTheFullGraphPeriodically) {
  Walker walker(60);
  walker.go_to(1200);
  // Starts with a loop after the thousandth keyframe, is applied a hundredth later, and repeats after a growth by a
  // twentieth.
  ASSERT_GE(walker.full_results_taken.size(), 2u);
  EXPECT_GE(walker.full_results_taken[0], 1000u + 10);
  EXPECT_LT(walker.full_results_taken[0], 1000u + 10 + 50);
  EXPECT_GE(walker.full_results_taken[1], walker.full_results_taken[0] + 50);
  walker.finish();
  EXPECT_TRUE(walker.accepts_all_loops());
  EXPECT_FALSE(walker.saved().has_pending_loops);
}

TEST(GraphScheduler, ResumesWithIdenticalResults) {
  Walker uninterrupted(60), resumed(60);
  uninterrupted.go_to(1200);
  // While loops are closed, during the full optimization, and shortly before its application.
  resumed.go_to(500);
  resumed.resume();
  while (!resumed.saved().full && resumed.atlas.keyframes.size() < 1200)
    resumed.go_to(resumed.atlas.keyframes.size() + 1);
  ASSERT_TRUE(resumed.saved().full);
  resumed.resume();
  resumed.go_to(resumed.atlas.keyframes.size() + 5);
  ASSERT_TRUE(resumed.saved().full);
  resumed.resume();
  resumed.go_to(1200);
  uninterrupted.finish();
  resumed.finish();
  for (std::size_t k = 0; k < 1200; ++k)
    ASSERT_EQ(uninterrupted.atlas.world_from_camera[k].matrix(), resumed.atlas.world_from_camera[k].matrix()) << k;
}

}  // namespace
}  // namespace cairn
