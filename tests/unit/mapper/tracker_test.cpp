// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/tracker.hpp"

#include <gtest/gtest.h>

#include "preprocess/preprocess.hpp"
#include "support/scenes.hpp"
#include "volume/integrate.hpp"

namespace cairn {
namespace {

/// Room with some fused frames, and a function to add keyframes.
struct Tracking {
  Tracking() {
    for (std::uint32_t i = 0; i < 4; ++i) {
      first = scene_frame(synthetic_scene("room"), camera, static_cast<int>(i));
      const FramePyramid live = preprocessor.preprocess(first);
      integrator.integrate(live, *first.world_from_camera, volume, i + 2);
      tracker.commit(first, live,
                     {.state = TrackingResult::State::initialized, .submap_from_camera = *first.world_from_camera});
    }
  }
  void add_keyframe(const Frame& seen, const std::optional<Eigen::Isometry3d>& tracked_from_camera) {
    const Features features = extract_features(seen.color, seen.depth, camera);
    images.put(keyframes.size(), seen, features);
    keyframes.add(tracked_from_camera, features);
  }
  Camera camera = small_camera();
  Options options;
  Frame first, next = scene_frame(synthetic_scene("room"), camera, 5);
  Preprocessor preprocessor{test_device(), camera, {}, 3, 1};
  Integrator integrator{test_device(), camera, {}};
  Volume volume{test_device(), options.fuse, 5.0f};
  KeyframeDatabase keyframes;
  KeyframeStore images{camera, {}};
  Tracker tracker{test_device(), camera, camera, options, keyframes, images};
  StageTimes times;
  [[nodiscard]] static int raycasts() {
    const auto times = test_device().kernel_times();
    const auto found = times.find("raycast");
    return found == times.end() ? 0 : found->second.calls;
  }
};

TEST(Tracker, RelocalizesOnlyAgainstKeyframesInTheTrackingFrame) {
  Tracking t;
  t.add_keyframe(t.first, *t.first.world_from_camera);
  t.add_keyframe(t.next, std::nullopt);  // identical, but in another component's frame
  t.tracker.start_lost();
  const TrackingResult tracked = t.tracker.track(t.next, t.preprocessor.preprocess(t.next), t.volume, t.times);
  ASSERT_TRUE(tracked.alignment.converged()) << tracked.reason;
  EXPECT_LT((tracked.alignment.submap_from_camera.translation() - t.next.world_from_camera->translation()).norm(),
            0.02);
}

TEST(Tracker, StartsLostAtTheNewestKeyframeInTheTrackingFrame) {
  Tracking t;
  t.add_keyframe(t.first, *t.first.world_from_camera);
  t.add_keyframe(t.next, std::nullopt);
  t.tracker.start_lost();
  ASSERT_EQ(t.tracker.state().last.size(), 1u);
  EXPECT_EQ(t.tracker.state().last[0].submap_from_camera.matrix(), t.first.world_from_camera->matrix());
}

TEST(Tracker, DoesNotRelocalizeByDepthAlone) {
  // A recording with an arbitrary start: walls match the newest place, but no corners do.
  Tracking t;
  t.add_keyframe(t.first, *t.first.world_from_camera);
  for (int i = 100; i <= 620; i += 40) {  // all around the room
    const Frame elsewhere = scene_frame(synthetic_scene("room"), t.camera, i);
    t.tracker.start_lost();
    const TrackingResult tracked = t.tracker.track(elsewhere, t.preprocessor.preprocess(elsewhere), t.volume, t.times);
    const double error =
        (tracked.alignment.submap_from_camera.translation() - elsewhere.world_from_camera->translation()).norm();
    EXPECT_TRUE(!tracked.alignment.converged() || error < 0.02)
        << i << ", " << to_string(tracked.guess) << ": " << error;
  }
}

/// Covers a share of the image, from the left, with a near object.
Frame covered(Frame frame, const Camera& camera, double share) {
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < static_cast<int>(share * camera.width); ++x)
      if (float& z = frame.depth[static_cast<std::size_t>(y * camera.width + x)]; z > 0) z = 0.8f;
  return frame;
}

TEST(Tracker, MasksMovingPixelsAtTheFinalPose) {
  Tracking t;
  t.add_keyframe(t.first, *t.first.world_from_camera);
  const Frame frame = covered(t.next, t.camera, 0.1);
  const auto track = [&] { return t.tracker.track(frame, t.preprocessor.preprocess(frame), t.volume, t.times); };
  const TrackingResult typical = track();
  ASSERT_EQ(typical.state, TrackingResult::State::aligned) << typical.reason;
  const double moving = t.tracker.moving();
  EXPECT_GT(moving, 0.05);
  // Testing and rejecting another guess predicts the map from another pose.
  const int before = t.raycasts();
  Tracker::State state = t.tracker.state();
  state.typical.photometric_rmse = 1e-6;  // every change is sudden
  t.tracker.restore({.state = state, .reference = t.tracker.save().reference});
  const TrackingResult doubted = track();
  EXPECT_EQ(doubted.guess, InitialGuess::motion);
  EXPECT_EQ(t.tracker.moving(), moving);
  EXPECT_GT(t.raycasts() - before, 3) << "no other guess was tried";
}

TEST(Tracker, UpdatesThePredictionAfterFiveFramesOrAViewChange) {
  Tracking t;
  t.add_keyframe(t.first, *t.first.world_from_camera);
  const auto raycasts_of = [&](const Frame& frame, Tracker& tracker) {
    const int before = t.raycasts();
    const FramePyramid live = t.preprocessor.preprocess(frame);
    const TrackingResult tracked = tracker.track(frame, live, t.volume, t.times);
    EXPECT_EQ(tracked.state, TrackingResult::State::aligned) << tracked.reason;
    return t.raycasts() - before;
  };
  const auto still = [&](Tracker& tracker) {
    std::vector<int> raycasts;
    for (int i = 0; i < 7; ++i) raycasts.push_back(raycasts_of(t.next, tracker));
    return raycasts;
  };
  EXPECT_EQ(still(t.tracker), (std::vector{1, 0, 0, 0, 0, 1, 0}));
  // A tracker restored from the saved state gives the same results.
  Tracker again{test_device(), t.camera, t.camera, t.options, t.keyframes, t.images};
  again.restore(t.tracker.save());
  EXPECT_EQ(again.save().prediction.points, t.tracker.save().prediction.points);
  EXPECT_EQ(still(again), still(t.tracker));
  // A prediction from another place does not match.
  Tracker::SavedState moved = t.tracker.save();
  moved.prediction.submap_from_camera.translate(Eigen::Vector3d(0.3, 0, 0));
  again.restore(moved);
  EXPECT_GT(raycasts_of(t.next, again), 0);
}

TEST(Tracker, IgnoresMotionOverMuchOfTheImage) {
  Tracking t;
  for (const double share : {0.25, 0.4}) {  // kMaxMoving: 0.3
    const Frame frame = covered(t.next, t.camera, share);
    const TrackingResult tracked = t.tracker.track(frame, t.preprocessor.preprocess(frame), t.volume, t.times);
    ASSERT_EQ(tracked.state, TrackingResult::State::aligned) << tracked.reason;
    if (share < 0.3)
      EXPECT_GT(t.tracker.moving(), 0.15);
    else
      EXPECT_EQ(t.tracker.moving(), 0);
  }
}

/// Depth on a share of the pixels, unrelated to the map.
Frame patchy(const Camera& camera, double share) {
  Frame frame;
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  for (std::size_t i = 0; i < pixels; ++i)
    frame.depth.push_back(static_cast<double>(i) < share * static_cast<double>(pixels) ? 0.5f + 1e-3f * (i % 7) : 0.0f);
  return frame;
}

TEST(Tracker, StartsAComponentAfterEnoughLostFramesWithDepth) {
  for (const double share : {0.19, 0.21}) {  // kEnoughDepth: 0.2
    Tracking t;
    t.options.map.lost_frames = 3;
    Tracker tracker(test_device(), t.camera, t.camera, t.options, t.keyframes, t.images);
    t.add_keyframe(t.first, *t.first.world_from_camera);
    tracker.start_lost();
    const Frame frame = patchy(t.camera, share);
    const FramePyramid live = t.preprocessor.preprocess(frame);
    for (int i = 0; i < 2; ++i)
      EXPECT_EQ(tracker.track(frame, live, t.volume, t.times).state, TrackingResult::State::lost);
    const TrackingResult third = tracker.track(frame, live, t.volume, t.times);
    EXPECT_EQ(third.state, share > 0.2 ? TrackingResult::State::initialized : TrackingResult::State::lost)
        << third.reason;
    if (share > 0.2) {
      EXPECT_EQ(third.cause, FrameCause::new_component);
    }
  }
}

TEST(Tracker, StartsAMapOnlyWithEnoughDepth) {
  for (const double share : {0.019, 0.021}) {  // kLeastDepth: 0.02
    Tracking t;
    Tracker tracker(test_device(), t.camera, t.camera, t.options, t.keyframes, t.images);
    const Frame frame = patchy(t.camera, share);
    const TrackingResult tracked = tracker.track(frame, t.preprocessor.preprocess(frame), t.volume, t.times);
    EXPECT_EQ(tracked.state, share > 0.02 ? TrackingResult::State::initialized : TrackingResult::State::lost);
    EXPECT_EQ(tracked.cause, share > 0.02 ? FrameCause::none : FrameCause::too_little_depth);
  }
}

TEST(Tracker, AcceptsAClockOffsetWithEnoughEvidence) {
  Tracking t;
  const auto offset = [&](int frames, double contrast) {
    Tracker::State state;
    state.clock_offset_frames = frames;
    state.clock_offset_costs = {1, 1, 1, 1, 1, 1, 1, contrast};
    t.tracker.restore({.state = state});
    return t.tracker.clock_offset();
  };
  EXPECT_EQ(offset(9, 1.6), 0);
  EXPECT_NE(offset(10, 1.6), 0);
  EXPECT_EQ(offset(10, 1.49), 0);
  EXPECT_NE(offset(10, 1.51), 0);
}

TEST(Tracker, EstimatesTheFocalLengthFromEnoughPairs) {
  Tracking t;
  for (const int pairs : {3, 4}) {
    Tracker::State state;
    state.focal_pairs = pairs;
    state.focal_costs.fill(1);
    state.focal_costs[6] = 0.5;
    t.tracker.restore({.state = state});
    EXPECT_EQ(t.tracker.focal().pairs, pairs < 4 ? 0 : 4);
  }
}

TEST(Tracker, UsesOnlyRotatedKeyframePairsForTheFocalLength) {
  for (const double angle : {0.09, 0.11}) {  // kFocalTurn: 0.1 rad
    Tracking t;
    Frame rotated = t.first;
    Eigen::Isometry3d pose = *t.first.world_from_camera;
    pose.rotate(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()));
    t.add_keyframe(t.first, *t.first.world_from_camera);
    t.add_keyframe(scene_frame_at(synthetic_scene("room"), t.camera, pose), pose);
    t.tracker.add_focal_evidence();
    EXPECT_EQ(t.tracker.state().focal_pairs, angle > 0.1 ? 1 : 0);
  }
}

}  // namespace
}  // namespace cairn
