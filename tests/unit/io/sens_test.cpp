// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/sens.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr int kFrames = 4;
constexpr std::uint64_t kFirstTime = 5'000'000;  // microseconds
const Camera kDepthCamera{64, 48, 52.5, 52.25, 31.5, 23.75, {}};
const Camera kColorCamera{96, 80, 90.5, 90.25, 47.5, 40.25, {}};

template <class T>
std::string bytes(const T& value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}
std::string rows(const Eigen::Matrix4d& m) {
  std::string text;
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) text += bytes(static_cast<float>(m(r, c)));
  return text;
}
std::string intrinsic(const Camera& camera) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m(0, 0) = camera.fx, m(1, 1) = camera.fy, m(0, 2) = camera.cx, m(1, 2) = camera.cy;
  return rows(m);
}

/// Content of the file, and its defects.
struct Written {
  int color_kind = 1, depth_kind = 1;
  std::uint32_t version = 4;
  std::uint64_t frames = kFrames;
  float depth_shift = 4000;
  bool stamped = true;
  bool backwards = false;  // last frame first
  int bad_depth = -1;      // frame with corrupt depth bytes
  Eigen::Isometry3d color_extrinsic = Eigen::Isometry3d(Eigen::Translation3d(0.025, 0, 0));
};

struct Recorded {
  std::vector<Frame> frames;   // depth rounded to the file's units
  std::vector<cv::Mat> color;  // BGR
};

const Recorded& recorded() {
  static const Recorded made = [] {
    Recorded all;
    const Scene scene = synthetic_scene("room");
    for (int i = 0; i < kFrames; ++i) {
      all.frames.push_back(scene_frame(scene, kDepthCamera, i));
      auto color = scene_frame(scene, kColorCamera, i).color;
      cv::Mat bgr;
      cv::cvtColor(cv::Mat(kColorCamera.height, kColorCamera.width, CV_8UC4, color.data()), bgr, cv::COLOR_RGBA2BGR);
      all.color.push_back(bgr);
    }
    return all;
  }();
  return made;
}

std::vector<std::uint16_t> units_of(const Frame& frame, float scale) {
  std::vector<std::uint16_t> units;
  for (const float meters : frame.depth) units.push_back(static_cast<std::uint16_t>(std::lround(meters * scale)));
  return units;
}

std::string depth_bytes(const Frame& frame, const Written& w) {
  const auto units = units_of(frame, w.depth_shift);
  std::string raw(reinterpret_cast<const char*>(units.data()), 2 * units.size());
  if (w.depth_kind == 0) return raw;
  uLongf size = compressBound(static_cast<uLong>(raw.size()));
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(raw.data()),
           static_cast<uLong>(raw.size()));
  packed.resize(size);
  return packed;
}

std::string color_bytes(const cv::Mat& bgr, int kind) {
  if (kind == 0) {
    cv::Mat rgb;
    cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
    return {reinterpret_cast<const char*>(rgb.data), rgb.total() * 3};
  }
  std::vector<std::uint8_t> packed;
  cv::imencode(kind == 1 ? ".png" : ".jpg", bgr, packed);
  return {packed.begin(), packed.end()};
}

std::string sens(const Written& w = {}) {
  std::string file = bytes(w.version) + bytes(std::uint64_t{9}) + "StructSen" + intrinsic(kColorCamera) +
                     rows(w.color_extrinsic.matrix()) + intrinsic(kDepthCamera) + rows(Eigen::Matrix4d::Identity()) +
                     bytes(w.color_kind) + bytes(w.depth_kind);
  for (const int pixels : {kColorCamera.width, kColorCamera.height, kDepthCamera.width, kDepthCamera.height})
    file += bytes(static_cast<std::uint32_t>(pixels));
  file += bytes(w.depth_shift) + bytes(w.frames);
  for (std::size_t k = 0; k < w.frames; ++k) {
    const std::size_t i = w.backwards ? w.frames - 1 - k : k;
    const Frame& frame = recorded().frames[i];
    Eigen::Matrix4d pose = frame.world_from_camera->matrix();
    if (i == 2) pose.setConstant(-std::numeric_limits<double>::infinity());
    const std::uint64_t time = w.stamped ? kFirstTime + 33'000 * i : 0;
    const auto color = color_bytes(recorded().color[i], w.color_kind);
    auto depth = depth_bytes(frame, w);
    if (w.bad_depth == static_cast<int>(i)) depth = "nonsense";
    file += rows(pose) + bytes(w.stamped ? time + 4'000 : 0) + bytes(time) + bytes(std::uint64_t{color.size()}) +
            bytes(std::uint64_t{depth.size()}) + color + depth;
  }
  return file + bytes(std::uint64_t{1}) + std::string(15 * 8 + 8, '\1');  // inertial frames
}

struct InFile {
  TemporaryFolder folder;
  std::filesystem::path file = folder / "scene.sens";
  explicit InFile(const std::string& content) { write_text(file, content); }
};

std::vector<Frame> read(const std::string& content, const FrameRange& range = {}) {
  const InFile in(content);
  const auto source = open_source(in.file, {.range = range});
  std::vector<Frame> frames;
  while (auto frame = source->next()) frames.push_back(std::move(*frame));
  return frames;
}

std::string error_of_opening(const std::string& content) {
  const InFile in(content);
  return error_of([&] { (void)open_source(in.file); });
}

TEST(Sens, ReadsEveryCompression) {
  for (const auto& [color_kind, depth_kind] : {std::pair{0, 0}, {1, 1}, {2, 1}}) {
    const Written w{.color_kind = color_kind, .depth_kind = depth_kind};
    const auto frames = read(sens(w));
    ASSERT_EQ(frames.size(), std::size_t{kFrames});
    for (std::size_t i = 0; i < kFrames; ++i) {
      ASSERT_FALSE(frames[i].problem) << *frames[i].problem;
      EXPECT_DOUBLE_EQ(frames[i].timestamp, 5.0 + 0.033 * static_cast<double>(i));
      EXPECT_NEAR(frames[i].color_delay, 0.004, 1e-9);
      const auto units = units_of(recorded().frames[i], w.depth_shift);
      ASSERT_EQ(frames[i].depth.size(), units.size());
      for (std::size_t p = 0; p < units.size(); ++p)
        ASSERT_EQ(frames[i].depth[p], static_cast<float>(units[p]) * (1.0f / w.depth_shift));
      ASSERT_EQ(frames[i].color.size(), recorded().color[i].total());
      if (color_kind == 2) continue;  // JPEG is lossy
      for (std::size_t p = 0; p < frames[i].color.size(); ++p) {
        const auto& bgr = recorded().color[i].at<cv::Vec3b>(static_cast<int>(p));
        ASSERT_EQ(frames[i].color[p], 0xff000000u | (bgr[0] << 16u) | (bgr[1] << 8u) | bgr[2]);
      }
    }
  }
}

TEST(Sens, ReadsBothCamerasAndExtrinsics) {
  const InFile in(sens());
  const Rig rig = open_source(in.file)->rig();
  EXPECT_EQ(rig.depth, kDepthCamera);
  ASSERT_TRUE(rig.color);
  EXPECT_EQ(rig.color->camera, kColorCamera);
  // The color camera is 2.5 cm to the right: points of the depth camera shift 2.5 cm to the left in its frame.
  EXPECT_NEAR(rig.color->color_from_depth.translation().x(), -0.025, 1e-7);
}

TEST(Sens, KeepsValidPosesAsTruth) {
  const InFile in(sens());
  const auto truth = recorded_truth(in.file);
  ASSERT_EQ(truth.size(), 3u);
  EXPECT_DOUBLE_EQ(truth[2].timestamp, 5.099);
  constexpr double kOfFloats = 1e-6;
  EXPECT_TRUE(truth[2].world_from_camera.isApprox(*recorded().frames[3].world_from_camera, kOfFloats));
}

TEST(Sens, ReadsOnlyRequestedFrames) {
  const auto frames = read(sens(), {.begin = 1, .end = 4, .step = 2});
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[1].index, 3);
}

TEST(Sens, SortsFramesByTime) {
  const std::string file = sens({.backwards = true});
  const auto frames = read(file);
  ASSERT_EQ(frames.size(), std::size_t{kFrames});
  for (std::size_t i = 0; i < kFrames; ++i) {
    ASSERT_FALSE(frames[i].problem) << *frames[i].problem;
    EXPECT_DOUBLE_EQ(frames[i].timestamp, 5.0 + 0.033 * static_cast<double>(i));
    EXPECT_NEAR(frames[i].depth[100], recorded().frames[i].depth[100], 1e-3);
  }
  const InFile in(file);
  const Trajectory truth = recorded_truth(in.file);
  ASSERT_EQ(truth.size(), std::size_t{kFrames - 1});  // without the invalid pose
  EXPECT_TRUE(truth[0].world_from_camera.isApprox(*recorded().frames[0].world_from_camera, 1e-5));
}

TEST(Sens, Assumes30HzWithoutTimestamps) {
  const auto frames = read(sens({.stamped = false}));
  EXPECT_DOUBLE_EQ(frames[3].timestamp, 0.1);
  EXPECT_EQ(frames[3].color_delay, 0);
}

TEST(Sens, KeepsFramesBeforeTruncation) {
  const std::string complete = sens();
  const InFile in(complete.substr(0, complete.size() - 1000));
  const auto source = open_source(in.file);
  EXPECT_FALSE(source->ended_early());
  int count = 0;
  while (source->next()) ++count;
  EXPECT_EQ(count, 3);
  ASSERT_TRUE(source->ended_early());
  EXPECT_NE(source->ended_early()->find("cut off in frame 3 of 4, which begins at byte"), std::string::npos);
}

TEST(Sens, ReportsBadFrameAndContinues) {
  const auto frames = read(sens({.bad_depth = 1}));
  ASSERT_EQ(frames.size(), std::size_t{kFrames});
  ASSERT_TRUE(frames[1].problem);
  EXPECT_NE(frames[1].problem->find("scene.sens: frame 1, byte "), std::string::npos) << *frames[1].problem;
  EXPECT_NE(frames[1].problem->find("zlib"), std::string::npos);
  EXPECT_FALSE(frames[2].problem);
}

TEST(Sens, RejectsInvalidFilesInOneLine) {
  const auto expect_error = [](const std::string& content, const char* expected) {
    const auto error = error_of_opening(content);
    EXPECT_NE(error.find("scene.sens"), std::string::npos) << error;
    EXPECT_NE(error.find(expected), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos);
  };
  expect_error("", "is empty");
  expect_error(sens().substr(0, 100), "ends at byte 100 within `extrinsic color`");
  expect_error(sens({.version = 3}), "version 3 at byte 0");
  expect_error(sens({.depth_kind = 2}), "OCCI");
  expect_error(sens({.color_kind = 7}), "color compression is 7");
  expect_error(sens({.frames = 0}), "no frame");
  expect_error(sens({.depth_shift = 0}), "depth_scale is 0");
  Eigen::Isometry3d stretched = Eigen::Isometry3d::Identity();
  stretched.linear() *= 2;
  expect_error(sens({.color_extrinsic = stretched}), "extrinsic matrix of color");
  EXPECT_NE(error_of([] { (void)open_source("nowhere.sens"); }).find("nowhere.sens"), std::string::npos);
}

}  // namespace
}  // namespace cairn
