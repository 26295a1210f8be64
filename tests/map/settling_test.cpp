// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/settling.hpp"

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
    const Settling::Memory memory = settling_->memory();
    settling_ = std::make_unique<Settling>();
    settling_->restore(memory, atlas);
  }
  void finish() {
    settling_->take_closing(atlas);
    settling_->finish(atlas);
  }
  [[nodiscard]] Settling::Memory memory() const { return settling_->memory(); }
  [[nodiscard]] bool believes_all_loops() const {
    return std::all_of(atlas.loops.begin(), atlas.loops.end(), [](const Loop& l) { return l.inlier; });
  }

  Atlas atlas;
  std::vector<std::size_t> whole_taken;  // number of keyframes at each application

 private:
  void step() {
    const bool runs = settling_->memory().whole.has_value();
    bool is_due = settling_->take(atlas);
    if (runs && !settling_->memory().whole) whole_taken.push_back(atlas.keyframes.size());
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
      settling_->add_loop();
    }
    if (is_due) settling_->begin(atlas);
  }

  LongWalk walk_;
  PoseGraph tracked_;
  std::unique_ptr<Settling> settling_ = std::make_unique<Settling>();
};

TEST(Settling, OptimisesALargeGraphAsAWholeNowAndThen) {
  Walker walker(60);
  walker.go_to(1200);
  // Starts with a loop after the thousandth keyframe, is applied a hundredth later, and repeats after a growth by a
  // twentieth.
  ASSERT_GE(walker.whole_taken.size(), 2u);
  EXPECT_GE(walker.whole_taken[0], 1000u + 10);
  EXPECT_LT(walker.whole_taken[0], 1000u + 10 + 50);
  EXPECT_GE(walker.whole_taken[1], walker.whole_taken[0] + 50);
  walker.finish();
  EXPECT_TRUE(walker.believes_all_loops());
  EXPECT_FALSE(walker.memory().unsettled);
}

TEST(Settling, GoesOnAsIfItHadNotBeenLeft) {
  Walker whole(60), left(60);
  whole.go_to(1200);
  // While loops are closed, during the full optimization, and shortly before its application.
  left.go_to(500);
  left.resume();
  while (!left.memory().whole && left.atlas.keyframes.size() < 1200) left.go_to(left.atlas.keyframes.size() + 1);
  ASSERT_TRUE(left.memory().whole);
  left.resume();
  left.go_to(left.atlas.keyframes.size() + 5);
  ASSERT_TRUE(left.memory().whole);
  left.resume();
  left.go_to(1200);
  whole.finish();
  left.finish();
  for (std::size_t k = 0; k < 1200; ++k)
    ASSERT_EQ(whole.atlas.world_from_camera[k].matrix(), left.atlas.world_from_camera[k].matrix()) << k;
}

}  // namespace
}  // namespace cairn
