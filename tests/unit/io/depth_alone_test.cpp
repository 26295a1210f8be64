// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings without color, with all their other data.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "cairn/io/inspect.hpp"
#include "io/recording.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kFrames = 4;
constexpr const char* kNoColor = "there is no color: only depth is used";

void write_depth(const fs::path& file, int i) {
  fs::create_directories(file.parent_path());
  cv::imwrite(file.string(), cv::Mat(48, 64, CV_16U, cv::Scalar(1000 + 10 * i)));
}
struct Opened {
  std::unique_ptr<Source> source;
  std::string output;
};
Opened open(const fs::path& folder) {
  testing::internal::CaptureStdout();
  std::unique_ptr<Source> source;
  std::string error;
  try {
    source = open_source(folder.string());
  } catch (const std::exception& e) {
    error = e.what();
  }
  std::string output = testing::internal::GetCapturedStdout();
  EXPECT_TRUE(source) << error;
  return {std::move(source), std::move(output)};
}
bool has(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }

void write_motion(const fs::path& folder, double begin) {
  std::string gyro, acceleration, truth;
  for (int i = 0; i < kFrames; ++i) {
    const double time = begin + i / 30.0 - 1e-4;  // matches the few digits in file names
    gyro += fmt::format("{:.6f} 0.1 0.2 0.3\n", time);
    acceleration += fmt::format("{:.6f} 0 9.81 0\n", time);
    truth += fmt::format("{:.6f} {} 0 0 0 0 0 1\n", time, i);
  }
  write_text(folder / "gyroscope.txt", gyro);
  write_text(folder / "accelerometer.txt", acceleration);
  write_text(folder / "groundtruth.txt", truth);
}

void expect_motion(const fs::path& folder) {
  const auto [source, output] = open(folder);
  ASSERT_TRUE(source);
  EXPECT_TRUE(has(output, kNoColor)) << output;
  for (int i = 0; i < kFrames; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame && !frame->problem);
    EXPECT_TRUE(frame->color.empty());
    EXPECT_EQ(frame->gyro.size(), 1u);
    ASSERT_TRUE(frame->acceleration);
    EXPECT_DOUBLE_EQ(frame->acceleration->y(), -9.81);
  }
  EXPECT_EQ(recorded_truth(folder).size(), static_cast<std::size_t>(kFrames));
}

TEST(DepthAlone, OfTumKeepsItsMotion) {
  const TemporaryFolder folder;
  std::string list;
  for (int i = 0; i < kFrames; ++i) {
    write_depth(folder / fmt::format("depth/{}.png", i), i);
    list += fmt::format("{:.6f} depth/{}.png\n", 10 + i / 30.0, i);
  }
  write_text(folder / "depth.txt", list);
  write_text(folder / "camera.yaml", "{fx: 50, fy: 50, cx: 31.5, cy: 23.5}");
  write_motion(folder.path(), 10);
  expect_motion(folder.path());
}

TEST(DepthAlone, OfAPlainFolderKeepsItsMotion) {
  for (const double begin : {0.0, 1305031102.0}) {
    const TemporaryFolder folder;
    for (int i = 0; i < kFrames; ++i)
      write_depth(
          folder / (begin > 0 ? fmt::format("depth/{:.6f}.png", begin + i / 30.0) : fmt::format("depth/{}.png", i)), i);
    write_text(folder / "camera.yaml", "{fx: 50, fy: 50, cx: 31.5, cy: 23.5, depth_scale: 1000}");
    write_motion(folder.path(), begin);
    expect_motion(folder.path());
  }
}

TEST(DepthAlone, IgnoresMotionOfAnotherTime) {
  const TemporaryFolder folder;
  for (int i = 0; i < kFrames; ++i) write_depth(folder / fmt::format("depth/{}.png", i), i);
  write_text(folder / "camera.yaml", "{fx: 50, fy: 50, cx: 31.5, cy: 23.5, depth_scale: 1000}");
  write_motion(folder.path(), 1e6);
  const auto [source, output] = open(folder.path());
  ASSERT_TRUE(source);
  for (const char* name : {"gyroscope.txt", "accelerometer.txt"})
    EXPECT_TRUE(
        has(output, fmt::format("the times of {} do not overlap with those of the images: the file is not used", name)))
        << output;
  EXPECT_TRUE(source->next()->gyro.empty());
}

#ifdef CAIRN_VIDEO
/// Writes a scan without its 1920x1440 video.
void write_stray(const fs::path& folder, double cx = 969.8, double cy = 715.6) {
  std::string odometry = "timestamp, frame, x, y, z, qx, qy, qz, qw\n", imu = "timestamp, alpha_x, alpha_y, alpha_z\n";
  for (int i = 0; i < kFrames; ++i) {
    write_depth(folder / fmt::format("depth/{:06}.png", i), i);
    odometry += fmt::format("{}, {:06}, {}, 0, 0, 0, 0, 0, 1\n", 5 + i / 60.0, i, i);
    imu += fmt::format("{}, 0.1, 0.2, 0.3\n", 5 + i / 60.0);
  }
  write_text(folder / "odometry.csv", odometry);
  write_text(folder / "imu.csv", imu);
  write_text(folder / "camera_matrix.csv", fmt::format("1320, 0, {}\n0, 1320, {}\n0, 0, 1\n", cx, cy));
}

TEST(DepthAlone, OfStrayScannerKeepsGyroscopeAndPoses) {
  const TemporaryFolder folder;
  write_stray(folder.path());
  const auto [source, output] = open(folder.path());
  ASSERT_TRUE(source);
  EXPECT_TRUE(has(output, kNoColor)) << output;
  EXPECT_EQ(source->layout(), "Stray Scanner folder");
  const Rig rig = source->rig();
  EXPECT_NEAR(rig.depth.fx, 1320 / 30.0, 1e-9);  // 1920 to 64 pixels
  EXPECT_NEAR(rig.depth.cx, (969.8 + 0.5) / 30 - 0.5, 1e-9);
  EXPECT_FALSE(rig.color);
  EXPECT_EQ(rig.sensor, sensor_model("phone_lidar"));
  const auto frame = source->next();
  ASSERT_TRUE(frame && !frame->problem);
  EXPECT_EQ(frame->gyro.size(), 1u);
  EXPECT_EQ(recorded_truth(folder.path()).size(), static_cast<std::size_t>(kFrames));
}

TEST(DepthAlone, StrayScannerWithoutVideoNeedsCamera) {
  const TemporaryFolder folder;
  write_stray(folder.path(), 400, 900);
  const std::string error = error_of([&] { (void)open_source(folder.path().string()); });
  EXPECT_TRUE(has(error, "fits no video size of ARKit, and rgb.mp4 is missing: give the camera")) << error;
}

TEST(DepthAlone, OfARealPhoneIsRead) {
  CAIRN_REQUIRE_DATA("iphone_lidar_580");
  const auto source = open_source((data_folder() / "iphone_lidar_580").string());
  EXPECT_EQ(source->size(), 580);
  EXPECT_NEAR(source->rig().depth.fx, 1327.616 * 256 / 1920, 1e-6);
}
#endif

}  // namespace
}  // namespace cairn
