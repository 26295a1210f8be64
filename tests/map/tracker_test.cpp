// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/tracker.hpp"

#include <gtest/gtest.h>

#include "support/scenes.hpp"
#include "surface/preprocess.hpp"
#include "volume/integrate.hpp"

namespace cairn {
namespace {

/// A room of which some frames were fused, and somebody who adds places.
struct Tracking {
  Tracking() {
    for (std::uint32_t i = 0; i < 4; ++i) {
      first = scene_frame(synthetic_scene("room"), camera, static_cast<int>(i));
      const Surface live = preprocessor.preprocess(first);
      integrator.integrate(live, *first.world_from_camera, volume, i + 2);
      tracker.accept(first, live, *first.world_from_camera, nullptr);
    }
  }
  void add_place(const Frame& seen, const Eigen::Isometry3d& submap_from_camera, bool is_here) {
    places.add({.submap_from_camera = submap_from_camera,
                .features = extract_features(seen.colour, seen.depth, camera),
                .is_here = is_here});
  }
  Camera camera = small_camera();
  Options options;
  Frame first, next = scene_frame(synthetic_scene("room"), camera, 5);
  Preprocessor preprocessor{test_device(), camera, {}, 3, 1};
  Integrator integrator{test_device(), camera, {}};
  Volume volume{test_device(), options.fuse, 5.0f};
  KeyframeDatabase places;
  Tracker tracker{test_device(), camera, camera, options, places};
  StageTimes times;
};

Eigen::Isometry3d aside(const Eigen::Isometry3d& pose) {
  Eigen::Isometry3d there = pose;
  there.pretranslate(Eigen::Vector3d(0.6, 0, 0.3));
  there.rotate(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY()));
  return there;
}

TEST(Tracker, ComparesALostFrameOnlyWithPlacesOfItsOwnFrame) {
  Tracking t;
  t.add_place(t.first, *t.first.world_from_camera, true);
  t.add_place(t.next, aside(*t.next.world_from_camera), false);  // as alike as can be, and in another piece's frame
  t.tracker.begin_lost();
  t.places[0].is_here = true;
  const Tracked tracked = t.tracker(t.next, t.preprocessor.preprocess(t.next), t.volume, t.times);
  ASSERT_TRUE(tracked.alignment.converged()) << tracked.alignment.lost;
  EXPECT_LT((tracked.alignment.submap_from_camera.translation() - t.next.world_from_camera->translation()).norm(),
            0.02);
}

TEST(Tracker, BeginsLostAtTheNewestPlaceOfItsOwnFrame) {
  Tracking t;
  t.add_place(t.first, *t.first.world_from_camera, true);
  t.add_place(t.next, aside(*t.next.world_from_camera), false);
  t.tracker.begin_lost();
  ASSERT_EQ(t.tracker.memory().last.size(), 1u);
  EXPECT_EQ(t.tracker.memory().last[0].submap_from_camera.matrix(), t.first.world_from_camera->matrix());
}

TEST(Tracker, TakesNoPlaceForAnotherByDepthAlone) {
  // A recording that begins anywhere: walls fit the walls of the newest place, but no corners do.
  Tracking t;
  t.add_place(t.first, *t.first.world_from_camera, true);
  for (int i = 100; i <= 620; i += 40) {  // all around the room
    const Frame elsewhere = scene_frame(synthetic_scene("room"), t.camera, i);
    t.tracker.begin_lost();
    const Tracked tracked = t.tracker(elsewhere, t.preprocessor.preprocess(elsewhere), t.volume, t.times);
    const double error =
        (tracked.alignment.submap_from_camera.translation() - elsewhere.world_from_camera->translation()).norm();
    EXPECT_TRUE(!tracked.alignment.converged() || error < 0.02) << i << ", " << tracked.guess << ": " << error;
  }
}

TEST(Tracker, LeavesOutWhatMovesAsSeenFromThePoseThatCounts) {
  Tracking t;
  Frame frame = t.next;
  for (int y = 100; y < 140; ++y)  // something came before the camera
    for (int x = 140; x < 190; ++x) frame.depth[static_cast<std::size_t>(y * t.camera.width + x)] = 0.8f;
  const Surface live = t.preprocessor.preprocess(frame);
  const Tracked tracked = t.tracker(frame, live, t.volume, t.times);
  ASSERT_TRUE(tracked.alignment.converged()) << tracked.alignment.lost;
  const double moving = t.tracker.leave_out_moving(live, tracked, t.volume);
  EXPECT_GT(moving, 0.01);
  // A guess that is tried and rejected afterwards shows the map from elsewhere.
  Tracked rejected = tracked;
  rejected.seen_from = aside(tracked.seen_from);
  EXPECT_NE(t.tracker.leave_out_moving(t.preprocessor.preprocess(frame), rejected, t.volume), moving);
  EXPECT_EQ(t.tracker.leave_out_moving(t.preprocessor.preprocess(frame), tracked, t.volume), moving);
}

}  // namespace
}  // namespace cairn
