// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/io/inspect.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgcodecs.hpp>

#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

class Given final : public Source {
 public:
  Given(const Rig& rig, std::vector<Frame> frames) : rig_(rig), frames_(std::move(frames)) {}
  const Rig& rig() const override { return rig_; }
  std::optional<int> size() const override { return static_cast<int>(frames_.size() - next_); }
  std::optional<Frame> next() override {
    return next_ < frames_.size() ? std::optional(frames_[next_++]) : std::nullopt;
  }

 private:
  Rig rig_;
  std::vector<Frame> frames_;
  std::size_t next_ = 0;
};

std::vector<Frame> room(int count, double rate) {
  std::vector<Frame> frames;
  for (int i = 0; i < count; ++i) {
    frames.push_back(scene_frame(synthetic_scene("room"), small_camera(), i));
    frames.back().timestamp = 7 + i / rate;
  }
  return frames;
}

bool doubts(const SourceSummary& summary, const std::string& text) {
  return std::any_of(summary.doubts.begin(), summary.doubts.end(),
                     [&](const std::string& d) { return d.find(text) != d.npos; });
}

TEST(Inspect, SummarizesRecording) {
  Given source(small_camera(), room(6, 20));
  const SourceSummary s = inspect(source, 5);
  EXPECT_EQ(s.frames, 6);
  EXPECT_EQ(s.inspected, 5);
  EXPECT_NEAR(s.rate, 20, 1e-6);
  EXPECT_NEAR(s.seconds, 0.2, 1e-9);
  EXPECT_EQ(s.with_color, 5);
  EXPECT_EQ(s.with_pose, 5);
  EXPECT_GT(s.nearest, 0.3);
  EXPECT_LT(s.nearest, s.median);
  EXPECT_LT(s.median, s.farthest);
  EXPECT_LT(s.farthest, 6);
  EXPECT_TRUE(s.doubts.empty()) << s.doubts[0];
}

TEST(Inspect, ReportsImplausibleProperties) {
  auto frames = room(4, 2);
  for (Frame& frame : frames) {
    frame.color_delay = 3600;
    for (float& z : frame.depth) z *= 1000;
  }
  frames[1].problem = "1.png: is cut off";
  frames[2].color.clear();
  Given source(small_camera(), frames);
  const SourceSummary s = inspect(source);
  EXPECT_TRUE(doubts(s, "1 of 4 frames cannot be read: 1.png: is cut off"));
  EXPECT_TRUE(doubts(s, "factor of 1000"));
  EXPECT_TRUE(doubts(s, "1 of 3 frames have no color"));
  EXPECT_TRUE(doubts(s, "clocks do not agree"));
  EXPECT_TRUE(doubts(s, "frames per second: tracking needs"));
}

TEST(Inspect, ReportsMissingColor) {
  auto frames = room(2, 30);
  for (Frame& frame : frames) frame.color.clear();
  Given source(small_camera(), frames);
  EXPECT_TRUE(doubts(inspect(source), "there is no color"));
  EXPECT_NE(error_of([&] { write_edges_picture("x.png", small_camera(), frames[0]); }).find("no color"),
            std::string::npos);
}

/// Frames with samples of both inertial sensors at 200 Hz, at rest but for some noise.
std::vector<Frame> with_inertial(std::vector<Frame> frames) {
  for (Frame& frame : frames)
    for (int i = 0; i < 10; ++i) {
      const double t = frame.timestamp + 0.005 * (i - 9), noise = 0.01 * std::sin(1e3 * t);
      frame.gyro.push_back({t, {noise, 2 * noise, -noise}});
      frame.accelerations.push_back({t, {noise, -9.81 + noise, 0.1 - noise}});
    }
  return frames;
}

TEST(Inspect, SummarizesInertialSensors) {
  Given source(small_camera(), with_inertial(room(8, 20)));
  const SourceSummary s = inspect(source);
  EXPECT_NEAR(s.inertial.gyroscope.rate, 200, 0.1);
  EXPECT_EQ(s.inertial.accelerometer.samples, 80);
  EXPECT_NEAR(s.inertial.accelerometer.longest_gap, 0.005, 1e-9);
  EXPECT_NEAR(s.inertial.norm, 9.81, 0.05);
  EXPECT_TRUE(s.doubts.empty()) << s.doubts[0];
}

TEST(Inspect, DoubtsInertialSensors) {
  const auto doubted = [](const std::function<void(Frame&)>& spoil, const std::string& text) {
    auto frames = with_inertial(room(8, 20));
    for (Frame& frame : frames) spoil(frame);
    Given source(small_camera(), frames);
    const SourceSummary s = inspect(source);
    return doubts(s, text) && s.doubts.size() == 1;
  };
  EXPECT_TRUE(doubted(
      [](Frame& f) {
        for (auto& a : f.accelerations) a.value /= 9.81;
      },
      "check its unit (g)"));
  EXPECT_TRUE(doubted(
      [](Frame& f) {
        for (auto& r : f.gyro) r.rate *= 5e3;
      },
      "check its unit (degrees/s)"));
  EXPECT_TRUE(doubted(
                  [](Frame& f) {
                    for (auto& r : f.gyro) r.rate.y() = std::min(r.rate.y(), 0.0);
                  },
                  "the gyroscope's y axis") == false);  // an extreme value that is not the largest magnitude
  EXPECT_TRUE(doubted(
      [](Frame& f) {
        for (auto& r : f.gyro) r.rate.z() = std::clamp(r.rate.z(), -0.004, 0.004);
      },
      "the gyroscope's z axis is saturated at 0.004"));
  EXPECT_TRUE(doubted(
      [](Frame& f) {
        for (auto& a : f.accelerations) a.value.x() = 0;
      },
      "the accelerometer's x axis is always 0: it is not measured"));
  EXPECT_TRUE(doubted(
                  [](Frame& f) {
                    if (f.timestamp > 7.12 && f.timestamp < 7.27) f.gyro.clear();
                  },
                  "the gyroscope has no sample for 0.15 s") ||
              doubted(
                  [](Frame& f) {
                    if (f.timestamp > 7.12 && f.timestamp < 7.27) f.gyro.clear();
                  },
                  "the gyroscope has no sample for 0.16 s"));
  EXPECT_TRUE(doubted(
      [](Frame& f) {
        for (auto& a : f.accelerations) a.timestamp += 0.3;
      },
      "not synchronized"));
}

TEST(Inspect, AcceptsEmptySource) {
  Given source(small_camera(), {});
  const SourceSummary s = inspect(source);
  EXPECT_EQ(s.inspected, 0);
  EXPECT_EQ(s.rate, 0);
}

TEST(Inspect, DrawsDepthEdges) {
  const TemporaryFolder folder;
  const Camera camera = small_camera();
  Frame frame{.depth = std::vector<float>(static_cast<std::size_t>(camera.width * camera.height), 2.0f)};
  frame.color.assign(frame.depth.size(), 0xff808080u);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < 100; ++x) frame.depth[static_cast<std::size_t>(y * camera.width + x)] = 1.0f;
  write_edges_picture(folder / "edges.png", camera, frame);
  const cv::Mat picture = cv::imread((folder / "edges.png").string());
  ASSERT_EQ(picture.cols, camera.width);
  EXPECT_EQ(picture.at<cv::Vec3b>(50, 99), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(picture.at<cv::Vec3b>(50, 90), cv::Vec3b(128, 128, 128));
  EXPECT_EQ(picture.at<cv::Vec3b>(50, 110), cv::Vec3b(128, 128, 128));
}

}  // namespace
}  // namespace cairn
