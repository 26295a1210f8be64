// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/eval/verdict.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "cairn/io/source.hpp"
#include "eval/view_step.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

/// Frames of the room along the camera's path, at `speed` times the normal speed.
class VerdictOfARoom : public testing::Test {
 protected:
  static constexpr int kFrames = 40, kKept = 12;  // total frames; fused frames, the rest are lost
  [[nodiscard]] static std::vector<Frame> frames(double speed = 1) {
    static const Scene scene = synthetic_scene("room");
    SceneRenderer renderer(test_device(), scene, small_camera());
    std::vector<Frame> all;
    for (int i = 0; i < kFrames; ++i) {
      auto images = renderer.render(scene.world_from_camera(speed * i / 30.0));
      all.push_back(
          {.index = i, .timestamp = i / 30.0, .depth = std::move(images.depth), .color = std::move(images.color)});
    }
    return all;
  }
  /// Verdict of the frames after a change of each.
  [[nodiscard]] static Verdict verdict_of(std::vector<Frame> all, const std::function<void(Frame&)>& change,
                                          int fused = kKept, const Rig& rig = small_camera()) {
    RunMonitor evidence(rig, Options{});
    for (Frame& frame : all) {
      change(frame);
      FrameReport report{.index = frame.index, .timestamp = frame.timestamp, .state = FrameState::fused};
      if (frame.index >= fused) report.state = FrameState::lost, report.cause = FrameCause::out_of_view;
      evidence.add(frame, report);
    }
    return evidence.verdict({.total = kFrames, .fused = fused});
  }
  static void expect_reason(const Verdict& verdict, const std::string& what) {
    ASSERT_FALSE(verdict.reasons.empty()) << what;
    EXPECT_NE(verdict.reasons.front().find(what), std::string::npos) << verdict.reasons.front();
  }
};

TEST_F(VerdictOfARoom, IsGoodWhenAllIsFused) {
  const Verdict verdict = verdict_of(
      frames(), [](Frame&) {}, kFrames);
  EXPECT_EQ(verdict.level, Verdict::Level::good);
  EXPECT_EQ(verdict.words, "40 of 40 frames are in the map");
  EXPECT_TRUE(verdict.reasons.empty()) << verdict.reasons.front();
}

TEST_F(VerdictOfARoom, GivesReasonsFromImageStatistics) {
  const std::vector<Frame> unchanged = frames();
  const auto scaled = [](float scale) {
    return [scale](Frame& frame) {
      for (float& z : frame.depth) z *= scale;
    };
  };
  const auto bad = [&](const std::function<void(Frame&)>& change) {
    const Verdict verdict = verdict_of(unchanged, change);
    EXPECT_EQ(verdict.level, Verdict::Level::bad);
    EXPECT_EQ(verdict.words, "mostly lost: only 12 of 40 frames are in the map");
    return verdict;
  };
  expect_reason(bad(scaled(1000)), "is depth_scale right? A value 1000 times as large would give");
  expect_reason(bad(scaled(0.001f)), "is depth_scale right? A value 1000 times as small would give");
  expect_reason(bad(scaled(4)), "too far: ");
  expect_reason(bad(scaled(0.1f)), "too near: ");
  expect_reason(bad([](Frame& frame) {
                  for (std::size_t i = 0; i < frame.depth.size(); ++i)
                    if (i % 10 != 0) frame.depth[i] = 0;
                }),
                "depth has holes: only 1");
  expect_reason(bad([](Frame& frame) {
                  for (std::uint32_t& c : frame.color) c = 0xff000000 | (c >> 4 & 0x0f0f0f);
                }),
                "too dark: ");
  expect_reason(bad([](Frame& frame) { frame.color.clear(); }), "there is no color");
  expect_reason(bad([](Frame& frame) {
                  if (frame.index >= kKept) frame.timestamp += 2;
                }),
                "gaps: the camera was lost where frames are missing, for 2.0 s at most");
  // Without a dominant cause: the most common property of the lost frames.
  expect_reason(bad([](Frame&) {}), "28 frames were lost: the map is out of view");
}

TEST_F(VerdictOfARoom, DistinguishesAFastCameraFromFewFrames) {
  const std::vector<Frame> fast = frames(30);
  const Verdict verdict = verdict_of(fast, [](Frame&) {});
  expect_reason(verdict, "too fast: where the camera was lost the view moves by");
  expect_reason(verdict_of(fast, [](Frame& frame) { frame.timestamp *= 12; }), "too few frames: about 2.");
}

TEST_F(VerdictOfARoom, NamesTheComputerAsReasonForDroppedFrames) {
  const auto reasons_of = [](const std::vector<Frame>& frames, const FrameRates& frame_rates) {
    RunMonitor evidence(small_camera(), Options{});
    for (const Frame& frame : frames) {
      FrameReport report{.state = frame.index < kKept ? FrameState::fused : FrameState::lost};
      if (report.state == FrameState::lost) report.cause = FrameCause::out_of_view;
      evidence.add(frame, report);
    }
    std::string all;
    for (const std::string& reason :
         evidence.verdict({.total = kFrames, .fused = kKept, .frame_rates = frame_rates}).reasons)
      all += reason + '\n';
    return all;
  };
  const std::vector<Frame> fast = frames(30);
  const std::string slow_computer = reasons_of(fast, {.dropped = 360, .processed = 3, .received = 30});
  EXPECT_NE(slow_computer.find("keeps up with 3 of 30 frames a second: use --voxel-size 0.02, or record first"),
            std::string::npos)
      << slow_computer;
  for (const char* blame : {"too fast", "slowly", "too few frames", "gaps"})
    EXPECT_EQ(slow_computer.find(blame), std::string::npos) << slow_computer;
  // A motion too fast for a camera with all frames is still reported.
  const std::string both = reasons_of(fast, {.dropped = 40, .processed = 20, .received = 30});
  EXPECT_NE(both.find("keeps up with 20 of 30"), std::string::npos) << both;
  EXPECT_NE(both.find("too fast"), std::string::npos) << both;
  const std::string keeps_up = reasons_of(fast, {.dropped = 4, .processed = 27, .received = 30});
  EXPECT_EQ(keeps_up.find("keeps up"), std::string::npos) << keeps_up;
  EXPECT_NE(keeps_up.find("too fast"), std::string::npos) << keeps_up;
}

TEST_F(VerdictOfARoom, SaysMostlyIfMoreThanHalfAreLost) {
  const RunMonitor evidence(small_camera(), Options{});
  const auto words_of = [&](int fused) { return evidence.verdict({.total = 60, .fused = fused}).words; };
  EXPECT_EQ(words_of(29), "mostly lost: only 29 of 60 frames are in the map");
  for (const int fused : {30, 43, 47})
    EXPECT_EQ(words_of(fused), "much is missing: only " + std::to_string(fused) + " of 60 frames are in the map");
  EXPECT_EQ(words_of(48), "48 of 60 frames are in the map: check what is missing");
}

TEST_F(VerdictOfARoom, FindsAWrongFocalLengthWithoutPoses) {
  const std::vector<Frame> turning = frames(3);
  Camera wrong = small_camera();
  wrong.fx *= 300.0 / 585, wrong.fy *= 300.0 / 585;
  for (const int fused : {kFrames, 0}) {  // also with all frames fused, and with none tracked
    const Verdict verdict = verdict_of(
        turning, [](Frame&) {}, fused, wrong);
    expect_reason(verdict, "check the camera's intrinsics (fx, fy)");
    const auto at = verdict.reasons.front().find("about ") + 6;
    EXPECT_NEAR(std::stod(verdict.reasons.front().substr(at)), 262.5, 45) << verdict.reasons.front();
    EXPECT_NE(verdict.level, Verdict::Level::good);
  }
  for (const std::string& reason : verdict_of(turning, [](Frame&) {}).reasons)
    EXPECT_EQ(reason.find("intrinsics"), std::string::npos) << reason;
}

TEST(Verdict, DoesNotCountHeldOutFramesAsMissing) {
  const RunMonitor evidence(small_camera(), {});
  const Verdict verdict = evidence.verdict({.total = 90, .fused = 90, .held_out = 10});
  EXPECT_EQ(verdict.level, Verdict::Level::good);
  EXPECT_EQ(verdict.words, "90 of 90 frames are in the map, 10 were held out");
}

TEST(Verdict, ReportsTheFocalLengthOnce) {
  RunSummary outcome{.total = 100, .fused = 100};
  const RunMonitor evidence(small_camera(), {});
  outcome.focal = {.scale = 1.1, .error_given = 2.0, .error_best = 1.0, .pairs = 12};
  ASSERT_EQ(evidence.verdict(outcome).reasons.size(), 1u);
  EXPECT_NE(evidence.verdict(outcome).reasons[0].find("check the camera's intrinsics"), std::string::npos);
  outcome.focal.scale = 1;
  EXPECT_TRUE(evidence.verdict(outcome).reasons.empty());
}

TEST_F(VerdictOfARoom, ContinuesAfterRestore) {
  const std::vector<Frame> all = frames(12);
  RunMonitor uninterrupted(small_camera(), {}), first(small_camera(), {}), second(small_camera(), {});
  for (const Frame& frame : all) {
    FrameReport report{.index = frame.index,
                       .timestamp = frame.timestamp,
                       .state = FrameState::lost,
                       .cause = FrameCause::out_of_view};
    if (frame.index % 2 == 0) report = {.index = frame.index, .timestamp = frame.timestamp, .state = FrameState::fused};
    uninterrupted.add(frame, report);
    if (frame.index == 20) second.restore(first.save());
    (frame.index < 20 ? first : second).add(frame, report);
  }
  const RunSummary outcome{.total = kFrames, .fused = kFrames / 2};
  EXPECT_EQ(second.verdict(outcome).reasons, uninterrupted.verdict(outcome).reasons);
  const std::string before = second.save();
  second.restore("what nobody saved");
  EXPECT_EQ(second.save(), before);
}

TEST(VerdictOfARecording, DistinguishesAWrongFromTheCorrectFocalLength) {
  CAIRN_REQUIRE_DATA("7scenes_redkitchen_600");
  const auto reasons_with = [](double focal) {
    const auto source = open_source((data_folder() / "7scenes_redkitchen_600").string(),
                                    {.range = {.end = 150}, .find_color_camera = false});
    Rig rig = source->rig();
    rig.depth.fx = rig.depth.fy = focal;
    RunMonitor evidence(rig, {});
    int frames = 0;
    while (const auto frame = source->next()) {
      ++frames;
      evidence.add(*frame, {.index = frame->index, .timestamp = frame->timestamp, .state = FrameState::fused});
    }
    std::string all;
    for (const std::string& reason : evidence.verdict({.total = frames, .fused = frames}).reasons) all += reason + '\n';
    return all;
  };
  EXPECT_EQ(reasons_with(585), "");
  EXPECT_NE(reasons_with(300).find("check the camera's intrinsics"), std::string::npos);
}

TEST(Verdict, DependsOnCountsComponentsAndWarnings) {
  const RunMonitor evidence(small_camera(), {});
  using Level = Verdict::Level;
  EXPECT_EQ(evidence.verdict({.total = 100, .fused = 95}).level, Level::good);
  EXPECT_EQ(evidence.verdict({.total = 100, .fused = 94}).level, Level::weak);
  EXPECT_EQ(evidence.verdict({.total = 100, .fused = 80}).level, Level::weak);
  EXPECT_EQ(evidence.verdict({.total = 100, .fused = 79}).level, Level::bad);
  const Verdict pieces = evidence.verdict({.total = 100, .fused = 100, .components = 3});
  EXPECT_EQ(pieces.level, Level::bad);
  EXPECT_NE(pieces.reasons.at(0).find("3 components of the map are not connected"), std::string::npos);
  const Verdict warned = evidence.verdict({.total = 100, .fused = 100, .warnings = {"it was unplugged"}});
  EXPECT_EQ(warned.level, Level::weak);
  EXPECT_EQ(warned.reasons, std::vector<std::string>{"it was unplugged"});
  EXPECT_EQ(evidence.verdict({.total = 3, .fused = 3}).reasons.at(0).find("only 3 frames"), 0u);
}

TEST(ViewStep, IsTheShiftOfTheImage) {
  const Scene scene = synthetic_scene("room");
  const Camera camera = small_camera();
  const Eigen::Isometry3d pose = scene.world_from_camera(1);
  const auto turned = [&](double angle) {
    Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
    turn.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
    return profile_of(scene_frame_at(scene, camera, pose * turn), camera);
  };
  const ViewProfile before = turned(0);
  for (const double angle : {0.0, 0.03, -0.05, 0.2, -0.3}) {
    const auto step = step_between(before, turned(angle));
    ASSERT_TRUE(step) << angle;
    EXPECT_NEAR(step->right, camera.fx * std::tan(angle) / camera.width, 0.03) << angle;
    EXPECT_NEAR(step->down, 0, 0.03) << angle;
  }
  // A uniform image provides no information.
  Frame plain = scene_frame_at(scene, camera, pose);
  for (std::uint32_t& c : plain.color) c = 0xff808080;
  EXPECT_FALSE(step_between(profile_of(plain, camera), profile_of(plain, camera)));
}

TEST(ViewProfile, DistinguishesABlurredFromASharpImage) {
  const Camera camera = small_camera();
  Frame frame = scene_frame(synthetic_scene("room"), camera, 30, true);
  const double sharp = profile_of(frame, camera).sharpness;
  // Each row is blurred over 12 pixels, as by a rotation during the exposure.
  const std::vector<std::uint32_t> image = frame.color;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x + 12 < camera.width; ++x) {
      std::array<std::uint32_t, 3> sum{};
      for (int k = 0; k < 12; ++k)
        for (std::uint32_t c = 0; c < 3; ++c)
          sum[c] += image[static_cast<std::size_t>(y * camera.width + x + k)] >> (8 * c) & 255;
      frame.color[static_cast<std::size_t>(y * camera.width + x)] =
          0xff000000 | sum[0] / 12 | (sum[1] / 12) << 8 | (sum[2] / 12) << 16;
    }
  const double blurred = profile_of(frame, camera).sharpness;
  EXPECT_LT(blurred, 0.33) << sharp;
  EXPECT_LT(blurred, 0.85 * sharp);
  EXPECT_GT(sharp, 0.33);
}

}  // namespace
}  // namespace cairn
