// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "cairn/io/layouts.hpp"
#include "cairn/io/source.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"
#include "support/videos.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kVideoError = 6;  // out of 255, mean error of a video with half chroma resolution, room scene

const Camera kColor{320, 240, 260, 262, 158, 121, {}};

/// Six images of the synthetic room in the app's format, every tenth frame of its path.
struct Scan {
  static constexpr int kFrames = 6;
  TemporaryFolder folder;
  std::vector<Frame> frames;  // ground truth, depth in whole mm

  explicit Scan(const char* codec = "libx264") {
    const Scene scene = synthetic_scene("room");
    const Camera depth_camera = kColor.at_level(2);
    std::vector<std::vector<std::uint32_t>> video;
    std::string odometry = kHeader;
    for (const char* name : {"depth", "confidence"}) fs::create_directories(folder / name);
    for (int i = 0; i < kFrames; ++i) {
      Frame frame = scene_frame(scene, depth_camera, 10 * i);
      frame.timestamp = 5000 + 0.1 * i;
      cv::Mat depth(60, 80, CV_16U), confidence(60, 80, CV_8U, cv::Scalar(2));
      confidence.row(7).setTo(0);
      confidence.row(8).setTo(1);
      for (int k = 0; k < 60 * 80; ++k) {
        float& z = frame.depth[static_cast<std::size_t>(k)];
        depth.at<std::uint16_t>(k / 80, k % 80) = static_cast<std::uint16_t>(std::lround(1000 * z));
        z = k / 80 == 7 ? 0 : static_cast<float>(std::lround(1000 * z)) * 1e-3f;
      }
      cv::imwrite((folder / fmt::format("depth/{:06}.png", i)).string(), depth);
      cv::imwrite((folder / fmt::format("confidence/{:06}.png", i)).string(), confidence);
      frame.color = scene_frame(scene, kColor, 10 * i).color;
      video.push_back(frame.color);
      odometry += line(i, frame);
      frames.push_back(std::move(frame));
    }
    write_text(folder / "odometry.csv", odometry);
    write_text(folder / "camera_matrix.csv", "260.0, 0.0, 158.0\n0.0, 262.0, 121.0\n0.0, 0.0, 1.0");
    write_mp4(folder / "rgb.mp4", video, 320, 240, 10, codec);
  }
  static std::string line(int i, const Frame& frame) {
    const Eigen::Quaterniond q(frame.world_from_camera->linear());
    const Eigen::Vector3d t = frame.world_from_camera->translation();
    return fmt::format("{:.9f}, {:06}, {:.9f}, {:.9f}, {:.9f}, {:.9f}, {:.9f}, {:.9f}, {:.9f}, 260, 262, , \n",
                       frame.timestamp, i, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  static constexpr const char* kHeader = "timestamp, frame, x, y, z, qx, qy, qz, qw, fx, fy, cx, cy\n";
  [[nodiscard]] std::unique_ptr<Source> open(const FrameRange& range = {}) const {
    return open_source(folder.path().string(), {.range = range});
  }
};

double mean_difference(const std::vector<std::uint32_t>& a, const std::vector<std::uint32_t>& b) {
  const auto* p = reinterpret_cast<const std::uint8_t*>(a.data());
  const auto* q = reinterpret_cast<const std::uint8_t*>(b.data());
  double sum = 0;
  for (std::size_t i = 0; i < 4 * a.size(); ++i) sum += std::abs(p[i] - q[i]);
  return sum / (3.0 * static_cast<double>(a.size()));
}

void expect_same(const Frame& frame, const Frame& truth) {
  ASSERT_FALSE(frame.problem) << *frame.problem;
  EXPECT_NEAR(frame.timestamp, truth.timestamp, 1e-6);
  EXPECT_EQ(frame.color_delay, 0);
  ASSERT_EQ(frame.depth.size(), truth.depth.size());
  ASSERT_EQ(frame.confidence.size(), truth.depth.size());
  for (std::size_t k = 0; k < truth.depth.size(); ++k)  // low-confidence pixels are filtered later by the sensor model
    ASSERT_NEAR(frame.confidence[k] == 0 ? 0 : frame.depth[k], truth.depth[k], 1e-6) << k;
  ASSERT_EQ(frame.color.size(), truth.color.size());
  EXPECT_LT(mean_difference(frame.color, truth.color), kVideoError);
}

TEST(StrayScanner, ReadsDepthAndVideoOfEachEncoding) {
  for (const char* codec : {"libx264", "libx265"}) {
    SCOPED_TRACE(codec);
    const Scan scan(codec);
    const auto source = scan.open();
    EXPECT_EQ(source->size(), Scan::kFrames);
    for (const Frame& truth : scan.frames) {
      const auto frame = source->next();
      ASSERT_TRUE(frame);
      expect_same(*frame, truth);
      // The color belongs to this frame, not to a neighbor.
      for (const Frame& other : scan.frames)
        EXPECT_LE(mean_difference(frame->color, truth.color), mean_difference(frame->color, other.color));
    }
    EXPECT_FALSE(source->next());
    EXPECT_FALSE(source->ended_early());
  }
}

TEST(StrayScanner, ScalesVideoCameraToDepth) {
  const Rig rig = Scan().open()->rig();
  ASSERT_TRUE(rig.color);
  EXPECT_EQ(rig.color->camera, kColor);
  EXPECT_TRUE(rig.color->color_from_depth.matrix().isIdentity());
  EXPECT_EQ(rig.depth, kColor.at_level(2));
}

/// Motion file for the scan's rotation, ten samples between frames, in the phone's axes (portrait: x right, y up, z out
/// of the screen) or in the camera's.
std::string motion_of(const Scan& scan, bool in_phones_axes = true) {
  std::string text = "timestamp, a_x, a_y, a_z, alpha_x, alpha_y, alpha_z\n";
  for (std::size_t i = 1; i < scan.frames.size(); ++i) {
    const Eigen::AngleAxisd turn(
        (scan.frames[i - 1].world_from_camera->inverse() * *scan.frames[i].world_from_camera).linear());
    const Eigen::Vector3d w = turn.angle() / 0.1 * turn.axis();
    // The camera's x points down the phone, and its y to the phone's left.
    const Eigen::Vector3d rate = in_phones_axes ? Eigen::Vector3d(-w.y(), -w.x(), -w.z()) : w;
    for (int k = 1; k <= 10; ++k)
      text += fmt::format("{:.6f}, 0, 0, -9.81, {:.12f}, {:.12f}, {:.12f}\n",
                          scan.frames[i - 1].timestamp + 0.01 * k - 1e-6, rate.x(), rate.y(), rate.z());
  }
  return text;
}

TEST(StrayScanner, ReadsTheAccelerometerInTheCamerasAxes) {
  const Scan scan;
  // Core Motion measures -1 g along the axis that points up: here z, out of the screen and against the camera's view.
  for (const bool is_in_g : {false, true}) {
    std::string motion = motion_of(scan);
    if (is_in_g)
      for (std::size_t at = 0; (at = motion.find("-9.81", at)) != std::string::npos;) motion.replace(at, 5, "-1.00");
    write_text(scan.folder / "imu.csv", motion);
    const auto source = scan.open();
    ASSERT_TRUE(source->next()->accelerations.empty());
    const auto frame = source->next();
    ASSERT_EQ(frame->accelerations.size(), 10u);
    EXPECT_EQ(frame->accelerations[0].timestamp, frame->gyro[0].timestamp);
    EXPECT_LT((frame->accelerations[0].value - Eigen::Vector3d(0, 0, -9.81)).norm(), 0.01) << is_in_g;
    EXPECT_FALSE(frame->acceleration);
  }
  write_text(scan.folder / "imu.csv", "timestamp, alpha_x, alpha_y, alpha_z\n5000.05, 0, 0, 0\n");
  const auto source = scan.open();
  ASSERT_TRUE(source->next());
  const auto frame = source->next();
  EXPECT_EQ(frame->gyro.size(), 1u);
  EXPECT_TRUE(frame->accelerations.empty());
}

TEST(StrayScanner, ReadsGyroscopeWithKnownRotation) {
  const Scan scan;
  EXPECT_FALSE(scan.open()->rig().camera_from_imu);
  write_text(scan.folder / "imu.csv", motion_of(scan));
  const auto source = scan.open();
  ASSERT_TRUE(source->rig().camera_from_imu);
  for (std::size_t i = 0; i < scan.frames.size(); ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    ASSERT_EQ(frame->gyro.size(), i == 0 ? 0u : 10u);
    Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
    for (const AngularRate& sample : frame->gyro) {
      const Eigen::Vector3d by = 0.01 * (*source->rig().camera_from_imu * sample.rate);
      turned = turned * Eigen::AngleAxisd(by.norm(), by.normalized());
    }
    const Frame& before = scan.frames[i == 0 ? 0 : i - 1];
    const Eigen::Isometry3d turn = before.world_from_camera->inverse() * *scan.frames[i].world_from_camera;
    EXPECT_LT(turned.angularDistance(Eigen::Quaterniond(turn.linear())), 1e-6);
  }
  // In other axes the samples are still read, and the rotation is estimated from the camera motion.
  write_text(scan.folder / "imu.csv", motion_of(scan, false));
  EXPECT_FALSE(scan.open()->rig().camera_from_imu);
  const auto other = scan.open();
  (void)other->next();
  EXPECT_EQ(other->next()->gyro.size(), 10u);
}

TEST(StrayScanner, KeepsFramesDespiteDamagedGyroscope) {
  const Scan scan;
  const std::string good = motion_of(scan), header = good.substr(0, good.find('\n') + 1);
  const auto middle = good.find('\n', good.size() / 2) + 1;
  const auto expect = [&](const std::string& text, const std::string& what, bool is_used) {
    SCOPED_TRACE(what);
    write_text(scan.folder / "imu.csv", text);
    testing::internal::CaptureStdout();
    const auto source = scan.open();
    const std::string output = testing::internal::GetCapturedStdout();
    EXPECT_NE(output.find((scan.folder / "imu.csv").string() + what), std::string::npos) << output;
    EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1) << output;
    std::size_t samples = 0;
    for (const Frame& truth : scan.frames) {
      const auto frame = source->next();
      ASSERT_TRUE(frame);
      expect_same(*frame, truth);
      samples += frame->gyro.size();
    }
    EXPECT_EQ(samples > 0, is_used);
    EXPECT_LT(samples, 50u);
  };
  expect("", ": holds no sample; the gyroscope is not used", false);
  expect("time, x\n1, 2\n", ": its header has no `timestamp`", false);
  expect(header + "5000.01, 0, 0\n", ":2: has fewer columns than the header; the gyroscope is not used", false);
  expect(good.substr(0, middle + 20), ":27: has fewer columns than the header; the gyroscope is used up to this line",
         true);
  expect(good.substr(0, middle) + "5000.3, 0, 0, 0, nan, 0, 0\n" + good.substr(middle), ":27: 'nan' is not a number",
         true);
  expect(good.substr(0, middle) + "5000.3, 0, 0, 0, 1, inf, 0\n", ":27: 'inf' is not a number", true);
  expect(header + "1, 0, 0, 0, 1, 2, 3\n2, 0, 0, 0, 1, 2, 3\n", ": its times do not overlap with those of odometry.csv",
         false);
}

TEST(StrayScanner, IsWrittenWithItsGyroscope) {
  const TemporaryFolder folder;
  Rig rig(small_camera());
  rig.camera_from_imu = Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX()));
  const auto writer = write_layout("stray-scanner", folder.path(), rig);
  std::vector<Eigen::Vector3d> rates;  // in the camera frame
  Eigen::Isometry3d before = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 4; ++i) {
    Frame frame = scene_frame(synthetic_scene("room"), small_camera(), 10 * i);
    frame.timestamp = 0.1 * (i + 1);
    const Eigen::AngleAxisd turn((before.inverse() * *frame.world_from_camera).linear());
    rates.push_back(i == 0 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(turn.angle() / 0.1 * turn.axis()));
    before = *frame.world_from_camera;
    frame.gyro = {{frame.timestamp - 0.05, rig.camera_from_imu->conjugate() * rates.back()}};
    writer->add(frame);
  }
  writer->finish();
  const auto source = open_source(folder.path());
  ASSERT_TRUE(source->rig().camera_from_imu);
  for (const Eigen::Vector3d& rate : rates) {
    const auto frame = source->next();
    ASSERT_TRUE(frame && frame->gyro.size() == 1);
    EXPECT_TRUE((*source->rig().camera_from_imu * frame->gyro[0].rate).isApprox(rate, 1e-9));
  }
}

TEST(StrayScanner, ReadsOdometryAsTruth) {
  const Scan scan;
  const Trajectory truth = recorded_truth(scan.folder.path());
  ASSERT_EQ(truth.size(), scan.frames.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_NEAR(truth[i].timestamp, scan.frames[i].timestamp, 1e-6);
    EXPECT_TRUE(truth[i].world_from_camera.isApprox(*scan.frames[i].world_from_camera, 1e-6));
  }
}

TEST(StrayScanner, SortsLinesByTime) {
  const Scan scan;
  std::string odometry = Scan::kHeader;
  for (const int i : {3, 0, 5, 1, 4, 2}) odometry += Scan::line(i, scan.frames[static_cast<std::size_t>(i)]);
  write_text(scan.folder / "odometry.csv", odometry);
  const auto source = scan.open();
  for (const Frame& truth : scan.frames) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    expect_same(*frame, truth);
    for (const Frame& other : scan.frames)
      EXPECT_LE(mean_difference(frame->color, truth.color), mean_difference(frame->color, other.color));
  }
}

TEST(StrayScanner, ReadsOnlyRequestedFrames) {
  const Scan scan;
  const auto source = scan.open({.begin = 1, .end = 5, .step = 3});
  expect_same(*source->next(), scan.frames[1]);
  expect_same(*source->next(), scan.frames[4]);
  EXPECT_FALSE(source->next());
}

TEST(StrayScanner, KeepsFramesBeforeTruncation) {
  const Scan scan;
  const fs::path odometry = scan.folder / "odometry.csv";
  const std::string text = read_bytes(odometry);
  write_text(odometry, text.substr(0, text.find(", 000004,") + 20));
  const auto source = scan.open();
  for (int i = 0; i < 4; ++i) expect_same(*source->next(), scan.frames[static_cast<std::size_t>(i)]);
  EXPECT_FALSE(source->next());
  ASSERT_TRUE(source->ended_early());
  EXPECT_EQ(*source->ended_early(),
            odometry.string() + ":6: has fewer columns than the header: the recording is cut off here");
}

TEST(StrayScanner, UsesDepthWithoutColorAfterVideoEnd) {
  const Scan scan;
  write_mp4(scan.folder / "rgb.mp4", {scan.frames[0].color, scan.frames[1].color}, 320, 240, 10, "libx264");
  const auto source = scan.open();
  for (int i = 0; i < Scan::kFrames; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_FALSE(frame->problem);
    EXPECT_EQ(frame->color.empty(), i >= 2);
  }
}

TEST(StrayScanner, DoesNotShiftImagesAfterDamagedOne) {
  const Scan scan;
  std::string bytes = read_bytes(scan.folder / "rgb.mp4");
  const auto middle = static_cast<std::ptrdiff_t>(bytes.find("mdat") + (bytes.find("moov") - bytes.find("mdat")) / 2);
  std::fill_n(bytes.begin() + middle, 2000, '\0');
  write_text(scan.folder / "rgb.mp4", bytes);
  const auto source = scan.open();
  int with_color = 0;
  for (const Frame& truth : scan.frames) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_FALSE(frame->problem);
    if (frame->color.empty()) continue;
    ++with_color;
    for (const Frame& other : scan.frames)
      EXPECT_LE(mean_difference(frame->color, truth.color), mean_difference(frame->color, other.color));
  }
  EXPECT_GE(with_color, 3);
}

TEST(StrayScanner, ReportsBadFrameAndContinues) {
  const Scan scan;
  fs::resize_file(scan.folder / "depth/000001.png", 100);
  fs::remove(scan.folder / "depth/000002.png");
  cv::imwrite((scan.folder / "confidence/000003.png").string(), cv::Mat(30, 40, CV_8U, cv::Scalar(2)));
  fs::remove(scan.folder / "confidence/000004.png");
  const auto source = scan.open();
  expect_same(*source->next(), scan.frames[0]);
  for (const char* problem :
       {"000001.png: the file is cut off", "000002.png: cannot be read", "000003.png: its confidence is 40x30"}) {
    const auto frame = source->next();
    ASSERT_TRUE(frame && frame->problem);
    EXPECT_NE(frame->problem->find(problem), std::string::npos) << *frame->problem;
  }
  EXPECT_GT(source->next()->depth[7 * 80 + 5], 0);  // no confidence image marks this pixel as doubtful
  expect_same(*source->next(), scan.frames[5]);
}

TEST(StrayScanner, RejectsInvalidFoldersWithReason) {
  const Scan good;
  const auto expect = [&](const std::string& what, const std::function<void(const fs::path&)>& damage) {
    const TemporaryFolder folder;
    fs::copy(good.folder.path(), folder.path(), fs::copy_options::recursive);
    damage(folder.path());
    const std::string output = error_of([&] { (void)open_source(folder.path().string()); });
    EXPECT_NE(output.find(what), std::string::npos) << output;
    EXPECT_EQ(output.find('\n'), std::string::npos) << output;
  };
  const auto with = [](const char* name, const std::string& text) {
    return [=](const fs::path& folder) { write_text(folder / name, text); };
  };
  const std::string header = Scan::kHeader;
  expect("camera_matrix.csv is missing", [](const fs::path& folder) { fs::remove(folder / "camera_matrix.csv"); });
  expect("odometry.csv is missing", [](const fs::path& folder) { fs::remove(folder / "odometry.csv"); });
  expect("depth: has no readable image NUMBER.png", [](const fs::path& folder) {
    fs::remove_all(folder / "depth");
    fs::create_directories(folder / "depth");
  });
  expect("camera_matrix.csv: expected the 3x3 matrix", with("camera_matrix.csv", "260, 0, 158\n0, 262, 121\n"));
  expect("camera_matrix.csv:2: 'x' is not a number", with("camera_matrix.csv", "260, 0, 158\n0, x, 121\n0, 0, 1"));
  expect("camera_matrix.csv: the camera's fx is", with("camera_matrix.csv", "1, 0, 158\n0, 262, 121\n0, 0, 1"));
  expect("odometry.csv: holds no pose", with("odometry.csv", ""));
  expect("odometry.csv: its header has no `timestamp`", with("odometry.csv", "0, 0, 0, 0, 0, 0, 1\n"));
  expect("odometry.csv:2: 'no' is not a number",
         with("odometry.csv", header + "no, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1\n"));
  expect("odometry.csv:2: the frame number", with("odometry.csv", header + "1, 0.5, 0, 0, 0, 0, 0, 0, 1\n"));
  expect("odometry.csv:2: the quaternion is zero", with("odometry.csv", header + "1, 0, 0, 0, 0, 0, 0, 0, 0\n"));
  expect("rgb.mp4: its video is encoded as mpeg4, expected H.264 or HEVC",
         [&](const fs::path& folder) { write_mp4(folder / "rgb.mp4", {good.frames[0].color}, 320, 240, 10, "mpeg4"); });
  expect("rgb.mp4: is empty", with("rgb.mp4", ""));
  expect("rgb.mp4: is cut off or not an MP4 file", with("rgb.mp4", "this is no video"));
  expect("rgb.mp4: is cut off or not an MP4 file",
         [](const fs::path& folder) { fs::resize_file(folder / "rgb.mp4", fs::file_size(folder / "rgb.mp4") / 2); });
}

}  // namespace
}  // namespace cairn
