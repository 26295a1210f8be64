// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A held-out frame gets a pose, and the map is the same as without it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "cairn/io/source.hpp"
#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/mesh.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr int kFrames = 24;
constexpr int kEvery = 4;
/// Of 255. The camera position for a keyframe's color depends on its velocity, computed from neighboring poses,
/// including held-out frames.
constexpr double kMovedColor = 1;
const Camera kSmall{160, 120, 131.25, 131.25, 79.5, 59.5, {}};

const std::vector<Frame>& room_frames() {
  static const std::vector<Frame> frames = [] {
    std::vector<Frame> made;
    for (int i = 0; i < kFrames; ++i) made.push_back(scene_frame(synthetic_scene("room"), kSmall, i));
    return made;
  }();
  return frames;
}

/// All frames with some held out, or only the rest.
std::vector<Frame> frames_of(bool with_held_out) {
  std::vector<Frame> frames;
  const auto source = hold_out(std::make_unique<GivenFrames>(kSmall, room_frames()), {.every = kEvery});
  while (const auto frame = source->next())
    if (with_held_out || !frame->held_out) frames.push_back(*frame);
  return frames;
}

Mapper mapped(const std::vector<Frame>& frames, Poses poses = Poses::tracked) {
  Options options{.fuse = {.voxel_size = 0.03f, .truncation = 0.12f}};
  options.track.finest_level = 0;
  Mapper mapper(kSmall, options, poses);
  for (const Frame& frame : frames)
    EXPECT_EQ(mapper.add(frame).state, frame.held_out ? FrameState::held_out : FrameState::fused) << frame.index;
  return mapper;
}

Texture texture_of(Mapper& mapper) {
  const TemporaryFolder folder;
  mapper.map().export_mesh(folder / "mesh.glb", {.texture = {.enabled = true}});
  return read_mesh_parts(folder / "mesh.glb").at(0).texture;
}

void expect_same_map(Mapper& a, Mapper& b) {
  const Mesh one = a.map().mesh(), other = b.map().mesh();
  ASSERT_FALSE(one.triangles.empty());
  EXPECT_TRUE(one.positions == other.positions && one.colors == other.colors && one.triangles == other.triangles);
  EXPECT_EQ(a.keyframes(), b.keyframes());
  const Texture first = texture_of(a), second = texture_of(b);
  ASSERT_EQ(first.texels.size(), second.texels.size());
  double difference = 0;
  for (std::size_t i = 0; i < first.texels.size(); ++i)
    difference += std::abs(first.texels[i][1] - second.texels[i][1]);
  EXPECT_LT(difference / static_cast<double>(first.texels.size()), kMovedColor);
}

TEST(HeldOutFrames, DoNotChangeTheMap) {
  Mapper with = mapped(frames_of(true)), without = mapped(frames_of(false));
  expect_same_map(with, without);
  with.refine(), without.refine();
  GivenFrames again(kSmall, frames_of(true)), others(kSmall, frames_of(false));
  with.reintegrate(again), without.reintegrate(others);
  EXPECT_TRUE(with.warnings().empty());
  expect_same_map(with, without);
}

TEST(HeldOutFrames, HavePosesInTheTrajectory) {
  Mapper mapper = mapped(frames_of(true));
  GivenFrames again(kSmall, frames_of(true));
  for (const bool fuses_again : {false, true}) {
    if (fuses_again) mapper.reintegrate(again);
    const Trajectory path = mapper.trajectory();
    ASSERT_EQ(path.size(), room_frames().size());
    const Eigen::Isometry3d& begin = *room_frames()[0].world_from_camera;
    for (std::size_t i = kEvery - 1; i < path.size(); i += kEvery) {
      const Eigen::Isometry3d truth = begin.inverse() * *room_frames()[i].world_from_camera,
                              found = path[0].world_from_camera.inverse() * path[i].world_from_camera;
      EXPECT_LT((truth.inverse() * found).translation().norm(), 0.01) << i;
    }
  }
}

TEST(HeldOutFrames, ChangeNothingIfLostOrFirst) {
  std::vector<Frame> spoilt = frames_of(true);
  for (Frame& frame : spoilt)
    if (frame.held_out) std::fill(frame.depth.begin(), frame.depth.end(), 0.0f);
  Options options{.fuse = {.voxel_size = 0.03f, .truncation = 0.12f}};
  options.track.finest_level = 0;
  options.map.lost_frames = 1;  // lost frames start a component
  Mapper mapper(kSmall, options);
  Frame first = spoilt[0];
  first.held_out = true, first.timestamp -= 1;
  const FrameReport report = mapper.add(first);
  EXPECT_EQ(report.state, FrameState::lost);
  EXPECT_NE(report.reason.find("before the start of the map"), std::string::npos) << report.reason;
  for (const Frame& frame : spoilt)
    EXPECT_EQ(mapper.add(frame).state, frame.held_out ? FrameState::lost : FrameState::fused) << frame.index;
  Mapper without = mapped(frames_of(false));
  expect_same_map(mapper, without);
  EXPECT_EQ(mapper.trajectory().size(), without.trajectory().size());
  mapper.begin_recording();
  EXPECT_EQ(mapper.add(first).state, FrameState::lost);
}

TEST(HeldOutFrames, AreNotFusedWithGivenPoses) {
  Mapper mapper = mapped(frames_of(true), Poses::given);
  EXPECT_EQ(mapper.trajectory().size(), room_frames().size());
  GivenFrames again(kSmall, frames_of(true));
  const auto triangles = [](Mapper& m) { return static_cast<double>(m.map().mesh().triangles.size()); };
  const double before = triangles(mapper);
  mapper.reintegrate(again);
  // Settled bricks take other turns in the second pass.
  Mapper all = mapped(room_frames(), Poses::given);
  EXPECT_LT(std::abs(triangles(mapper) - before), 0.05 * std::abs(triangles(all) - before));
}

TEST(HoldOut, CountsFromTheStartOfTheRange) {
  const auto held_out = [](int begins_at, const HoldOut& which) {
    std::vector<Frame> frames(10);
    for (int i = 0; i < 10; ++i) frames[static_cast<std::size_t>(i)].index = i;
    frames.erase(frames.begin(), frames.begin() + begins_at);
    const auto source = hold_out(std::make_unique<GivenFrames>(kSmall, frames), which);
    std::vector<int> indices;
    while (const auto frame = source->next())
      if (frame->held_out) indices.push_back(frame->index);
    return indices;
  };
  EXPECT_EQ(held_out(0, {.every = 3}), (std::vector{2, 5, 8}));
  EXPECT_EQ(held_out(4, {.every = 3}), (std::vector{5, 8}));
  EXPECT_EQ(held_out(0, {.every = 2, .range = {.begin = 1, .end = {}, .step = 3}}), (std::vector{4}));
  EXPECT_TRUE(held_out(0, {}).empty());
  for (const int every : {1, -4})
    EXPECT_NE(error_of([&] { (void)held_out(0, {.every = every}); }).find("give 2 or more"), std::string::npos);
}

}  // namespace
}  // namespace cairn
