// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Mapper::finish: the stages after the last frame in one call.
#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "cairn/mapping/mapper.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr int kFrames = 8;  // every second one of the scene's path

const std::vector<Frame>& frames() {
  static const std::vector<Frame> all = [] {
    std::vector<Frame> made;
    for (int i = 0; i < kFrames; ++i) made.push_back(scene_frame(synthetic_scene("room"), small_camera(), 2 * i, true));
    return made;
  }();
  return all;
}

Mapper mapped() {
  Mapper mapper(small_camera(), {.fuse = {.voxel_size = 0.02f, .truncation = 0.08f}});
  for (const Frame& frame : frames()) EXPECT_EQ(mapper.add(frame).state, FrameState::fused);
  return mapper;
}

TEST(Finish, IsEqualToItsSteps) {
  Mapper one = mapped(), other = mapped();
  GivenFrames source(small_camera(), frames()), again(small_camera(), frames());
  const FinishReport report = one.finish({.refine = true, .reintegrate = &source});
  const RefineReport refined = other.refine();
  const AdjustReport adjusted = other.adjust();
  other.reintegrate(again, adjusted.correction);
  other.freeze_gravity();
  ASSERT_TRUE(report.refined && report.adjusted && report.is_reintegrated);
  EXPECT_EQ(report.refined->pairs_tried, refined.pairs_tried);
  EXPECT_EQ(report.refined->cost, refined.cost);
  EXPECT_EQ(report.adjusted->observations, adjusted.observations);
  const Mesh mesh = one.map().mesh(), expected = other.map().mesh();
  EXPECT_FALSE(mesh.triangles.empty());
  EXPECT_TRUE(mesh.positions == expected.positions && mesh.triangles == expected.triangles);
  EXPECT_TRUE(one.warnings().empty());
}

TEST(Finish, ReportsProgressInTheOrderOfTheStages) {
  Mapper mapper = mapped();
  GivenFrames source(small_camera(), frames());
  std::vector<std::pair<FinishStage, double>> steps;
  (void)mapper.finish({.refine = true, .reintegrate = &source, .progress = [&](FinishStage stage, double fraction) {
                         steps.emplace_back(stage, fraction);
                         return true;
                       }});
  ASSERT_FALSE(steps.empty());
  EXPECT_TRUE(std::is_sorted(steps.begin(), steps.end()));
  EXPECT_EQ(steps.back(), std::pair(FinishStage::reintegrate, 1.0));
}

TEST(Finish, ReportsProgressOfAStreamWithoutSize) {
  struct Stream final : Source {
    GivenFrames all{small_camera(), frames()};
    [[nodiscard]] const Rig& rig() const override { return all.rig(); }
    [[nodiscard]] std::optional<int> size() const override { return std::nullopt; }
    [[nodiscard]] std::optional<Frame> next() override { return all.next(); }
  };
  Mapper mapper = mapped();
  Stream source;
  std::vector<double> fractions;
  (void)mapper.finish({.reintegrate = &source, .progress = [&](FinishStage stage, double fraction) {
                         if (stage == FinishStage::reintegrate) fractions.push_back(fraction);
                         return true;
                       }});
  ASSERT_FALSE(fractions.empty());
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_EQ(fractions.back(), 1.0);
}

TEST(Finish, SkipsTheStagesAfterACanceledStage) {
  Mapper mapper = mapped();
  ASSERT_GE(mapper.keyframes().size(), 2u);
  GivenFrames source(small_camera(), frames());
  const FinishReport report =
      mapper.finish({.refine = true, .reintegrate = &source, .progress = [](FinishStage, double) { return false; }});
  EXPECT_TRUE(report.refined);
  EXPECT_FALSE(report.adjusted);
  EXPECT_FALSE(report.is_reintegrated);
  EXPECT_EQ(mapper.warnings(), std::vector<std::string>{"interrupted; poses stay unchanged"});
}

TEST(Finish, AdjustsBeforeReintegration) {
  Mapper mapper = mapped();
  GivenFrames source(small_camera(), frames());
  const FinishReport report = mapper.finish({.reintegrate = &source});
  EXPECT_TRUE(report.adjusted && report.is_reintegrated);
  EXPECT_FALSE(report.refined);
}

TEST(Finish, RunsOnlyTheRequestedStages) {
  Mapper mapper = mapped();
  const FinishReport none = mapper.finish();
  EXPECT_FALSE(none.refined || none.adjusted || none.is_reintegrated);
  const FinishReport refined = mapper.finish({.refine = true});
  EXPECT_TRUE(refined.refined && !refined.adjusted);
  Mapper empty(small_camera());
  EXPECT_FALSE(empty.finish().refined);
}

}  // namespace
}  // namespace cairn
