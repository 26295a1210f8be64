// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/ros_source.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "cairn/io/inspect.hpp"
#include "io/ros/ros_recording.hpp"
#include "support/files.hpp"
#include "support/ros_files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

using ros::Wire;
constexpr int kFrames = 6;
constexpr std::int64_t kBegin = 1'700'000'000'000'000'000, kStep = 33'333'333, kDelay = 4'000'000;  // ns
constexpr std::int64_t kLate = 20'000'000;  // ns, message latency
const Camera kDepthCamera{64, 48, 52.5, 52.25, 31.5, 23.75, {}};
const Camera kColorCamera{96, 80, 90.5, 90.25, 47.5, 40.25, {0.1, -0.05, 0.001, 0.002, 0.01}};
const Eigen::Vector3d kRate(0.1, -0.2, 0.3), kUp(0, -9.81, 0);  // IMU frame; depth camera frame

/// depth_from_color: the color camera is 2.5 cm to the right of the depth camera and slightly rotated.
Eigen::Isometry3d depth_from_color() {
  Eigen::Isometry3d pose(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitY()));
  pose.translation() = Eigen::Vector3d(0.025, 0.001, -0.002);
  return pose;
}
/// depth_from_imu: the inertial sensor has x forward, y left and z up.
Eigen::Isometry3d depth_from_imu() {
  Eigen::Matrix3d turn;
  turn << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = turn;
  return pose;
}

struct Images {
  std::vector<Frame> frames;
  std::vector<std::vector<std::uint32_t>> color;
};
const Images& images() {
  static const Images made = [] {
    Images all;
    const Scene scene = synthetic_scene("room");
    for (int i = 0; i < kFrames; ++i) {
      all.frames.push_back(scene_frame(scene, kDepthCamera, i));
      all.color.push_back(scene_frame(scene, kColorCamera.rectified(), i).color);
    }
    return all;
  }();
  return made;
}

/// Content of a recording, and its defects.
struct Settings {
  Wire wire = Wire::ros1;
  std::string depth_encoding = "16UC1", color_encoding = "rgb8";
  std::string depth_topic = "/camera/depth/image_raw", color_topic = "/camera/color/image_raw";
  bool info = true, tf = true, imu = true;
  int color_every = 1;
  std::int64_t color_clock = 0;  // ns ahead of depth's clock
  int bad_depth = -1;
  double meters_per_meter = 1;
};

template <class T>
std::string raw(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}
std::vector<std::uint16_t> millimeters(const Frame& frame, double scale = 1) {
  std::vector<std::uint16_t> units;
  for (const float z : frame.depth) units.push_back(static_cast<std::uint16_t>(std::lround(1000 * scale * z)));
  return units;
}
std::string packed(const char* extension, const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(extension, image, bytes);
  return {bytes.begin(), bytes.end()};
}

std::string depth_message(const Settings& t, int i, std::int64_t stamp) {
  const Frame& frame = images().frames[static_cast<std::size_t>(i)];
  auto units = millimeters(frame, t.meters_per_meter);
  ros::ImageMessage m{stamp, "depth_optical", kDepthCamera.width, kDepthCamera.height, t.depth_encoding, raw(units), 2};
  if (t.depth_encoding == "32FC1") m.data = raw(frame.depth), m.pixel_size = 4;
  if (t.depth_encoding == "mono16") {  // big-endian, with padding after each row
    m.big_endian = true, m.more_per_row = 6, m.data.clear();
    for (std::size_t p = 0; p < units.size(); ++p) {
      m.data += static_cast<char>(units[p] >> 8);
      m.data += static_cast<char>(units[p] & 255);
      if ((p + 1) % static_cast<std::size_t>(kDepthCamera.width) == 0) m.data += "******";
    }
  }
  if (i == t.bad_depth) m.data.resize(10);
  if (t.depth_encoding.find("compressed") == std::string::npos && t.depth_encoding.find("png") == std::string::npos)
    return image(t.wire, m);
  if (t.depth_encoding.ends_with("rvl"))
    return compressed_image(t.wire, stamp, m.frame, t.depth_encoding, ros::rvl(units, kDepthCamera.width));
  const cv::Mat gray(kDepthCamera.height, kDepthCamera.width, CV_16UC1, units.data());
  const bool front = t.depth_encoding.find("compressedDepth") != std::string::npos;
  return compressed_image(t.wire, stamp, m.frame, t.depth_encoding,
                          std::string(front ? 12 : 0, '\1') + packed(".png", gray));
}

std::string color_message(const Settings& t, int i, std::int64_t stamp) {
  auto rgba = images().color[static_cast<std::size_t>(i)];
  const cv::Mat all(kColorCamera.height, kColorCamera.width, CV_8UC4, rgba.data());
  cv::Mat out;
  if (t.color_encoding == "rgb8")
    cv::cvtColor(all, out, cv::COLOR_RGBA2RGB);
  else if (t.color_encoding == "bgra8")
    cv::cvtColor(all, out, cv::COLOR_RGBA2BGRA);
  else if (t.color_encoding == "mono8")
    cv::cvtColor(all, out, cv::COLOR_RGBA2GRAY);
  else if (t.color_encoding == "rgba8")
    out = all.clone();
  else
    cv::cvtColor(all, out, cv::COLOR_RGBA2BGR);
  if (t.color_encoding.find("compressed") != std::string::npos)
    return compressed_image(t.wire, stamp, "color_optical", t.color_encoding,
                            packed(t.color_encoding.find("png") != std::string::npos ? ".png" : ".jpg", out));
  const std::string data(reinterpret_cast<const char*>(out.data), out.total() * out.elemSize());
  return image(t.wire, {stamp, "color_optical", kColorCamera.width, kColorCamera.height, t.color_encoding, data,
                        static_cast<int>(out.elemSize())});
}

std::string type_of(const std::string& encoding) {
  return encoding.find("compressed") == std::string::npos ? "sensor_msgs/Image" : "sensor_msgs/CompressedImage";
}

ros::Messages messages(const Settings& t = {}) {
  ros::Messages all;
  if (t.tf) {
    // Both cameras are children of a base frame, as on robots.
    Eigen::Isometry3d base_from_depth(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()));
    base_from_depth.translation() = Eigen::Vector3d(0.1, 0.2, 0.3);
    all.push_back({"/tf_static", "tf2_msgs/TFMessage", kBegin,
                   tf(t.wire, {{"base", "depth_optical", base_from_depth},
                               {"base", "color_optical", base_from_depth * depth_from_color()},
                               {"/depth_optical", "/imu", depth_from_imu()}})});
  }
  const std::vector<double> d(kColorCamera.distortion.begin(), kColorCamera.distortion.begin() + 5);
  for (int i = 0; i < kFrames; ++i) {
    const std::int64_t time = kBegin + i * kStep;
    for (int j = 0; t.imu && j < 4; ++j) {
      const std::int64_t at = time - kStep + (j + 1) * kStep / 4;
      all.push_back(
          {"/imu/data", "sensor_msgs/Imu", at, imu(t.wire, at, "imu", kRate * (4 * i + j + 1), {0, 0, 9.81})});
    }
    if (t.info) {
      all.push_back({"/camera/depth/camera_info", "sensor_msgs/CameraInfo", time,
                     camera_info(t.wire, "depth_optical", kDepthCamera, "plumb_bob", {0, 0, 0, 0, 0})});
      all.push_back({"/camera/color/camera_info", "sensor_msgs/CameraInfo", time,
                     camera_info(t.wire, "color_optical", kColorCamera, "plumb_bob", d)});
    }
    all.push_back({t.depth_topic, type_of(t.depth_encoding), time + kLate, depth_message(t, i, time)});
    if (t.color_every > 0 && i % t.color_every == 0)
      all.push_back({t.color_topic, type_of(t.color_encoding), time + kLate + kDelay,
                     color_message(t, i, time + kDelay + t.color_clock)});
  }
  return all;
}

struct InFile {
  TemporaryFolder folder;
  std::filesystem::path file;
  InFile(const std::string& name, const std::string& content) : file(folder / name) { write_text(file, content); }
  explicit InFile(const Settings& expected) : InFile("a.bag", bag(messages(expected))) {}
};

std::vector<Frame> read(const std::filesystem::path& file, const SourceOptions& options = {}) {
  const auto source = open_source(file, options);
  std::vector<Frame> frames;
  while (auto frame = source->next()) frames.push_back(std::move(*frame));
  return frames;
}

void expect_depth(const Frame& frame, std::size_t i) {
  ASSERT_FALSE(frame.problem) << *frame.problem;
  const auto units = millimeters(images().frames[i]);
  ASSERT_EQ(frame.depth.size(), units.size());
  for (std::size_t p = 0; p < units.size(); ++p) ASSERT_EQ(frame.depth[p], static_cast<float>(units[p]) * 1e-3f);
}

void expect_all(const std::filesystem::path& file) {
  const auto source = open_source(file);
  EXPECT_EQ(source->rig().depth, kDepthCamera);
  ASSERT_TRUE(source->rig().color);
  EXPECT_EQ(source->rig().color->camera, kColorCamera);
  EXPECT_TRUE(source->rig().color->color_from_depth.isApprox(depth_from_color().inverse(), 1e-9));
  ASSERT_TRUE(source->rig().camera_from_imu);
  EXPECT_TRUE(source->rig().camera_from_imu->isApprox(Eigen::Quaterniond(depth_from_imu().linear()), 1e-9));
  EXPECT_EQ(source->rig().sensor, SensorModel{});
  std::size_t i = 0;
  for (; const auto frame = source->next(); ++i) {
    SCOPED_TRACE(i);
    ASSERT_LT(i, std::size_t{kFrames});
    expect_depth(*frame, i);
    EXPECT_EQ(frame->color, images().color[i]);
    EXPECT_EQ(frame->index, static_cast<int>(i));
    constexpr double kOfDoubles = 1e-6;  // precision in seconds since 1970
    EXPECT_NEAR(frame->timestamp - 1.7e9, 1e-9 * kStep * static_cast<double>(i), kOfDoubles);
    EXPECT_NEAR(frame->color_delay, 1e-9 * kDelay, kOfDoubles);
    ASSERT_EQ(frame->gyro.size(), 4u);
    for (std::size_t j = 0; j < 4; ++j)
      EXPECT_TRUE(frame->gyro[j].rate.isApprox(kRate * static_cast<double>(4 * i + j + 1)));
    EXPECT_NEAR(frame->gyro[3].timestamp, frame->timestamp, kOfDoubles);
    ASSERT_TRUE(frame->acceleration);
    EXPECT_TRUE(frame->acceleration->isApprox(kUp, 1e-9));
  }
  EXPECT_EQ(i, std::size_t{kFrames});
  EXPECT_FALSE(source->ended_early()) << *source->ended_early();
}

TEST(RosSource, ReadsEveryBagFormat) {
  for (const char* compression : {"", "bz2", "lz4"}) {
    SCOPED_TRACE(compression);
    const InFile in("a.bag", bag(messages(), {.compression = compression}));
    expect_all(in.file);
    EXPECT_EQ(open_source(in.file)->size(), kFrames);
  }
}

TEST(RosSource, ReadsEveryMcapFormat) {
  for (const char* compression : {"", "lz4", "zstd"})
    for (const bool indexed : {true, false}) {
      SCOPED_TRACE(compression);
      const InFile in("a.mcap",
                      mcap(messages({.wire = Wire::little}), "cdr", {.compression = compression, .indexed = indexed}));
      if (indexed) expect_all(in.file);
      EXPECT_EQ(read(in.file).size(), std::size_t{kFrames});
    }
  expect_all(InFile("a.mcap", mcap(messages({.wire = Wire::big}), "cdr", {.compression = "zstd"})).file);
  expect_all(InFile("a.mcap", mcap(messages(), "ros1")).file);
  expect_all(InFile("a.mcap", mcap(messages(), "ros1", {.per_chunk = 0})).file);
}

TEST(RosSource, ReadsEveryRosbag2Format) {
  for (const char* compression : {"", "zstd"}) {
    SCOPED_TRACE(compression);
    const TemporaryFolder folder;
    const auto file = folder / "a_0.db3";
    write_db3(file, messages({.wire = Wire::little}), {.compression = compression});
    expect_all(file);
    write_text(folder / "metadata.yaml",
               "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  relative_file_paths:\n    "
               "- a_0.db3\n  compression_mode: MESSAGE\n");
    expect_all(folder.path());
    EXPECT_TRUE(recorded_truth(folder.path()).empty());
  }
}

TEST(RosSource, IsRecognizedByExtension) {
  expect_all(InFile("A.BAG", bag(messages())).file);
  expect_all(InFile("a.Mcap", mcap(messages(), "ros1")).file);
  const TemporaryFolder folder;
  write_db3(folder / "A.DB3", messages({.wire = Wire::little}), {});
  expect_all(folder / "A.DB3");
}

TEST(RosSource, ReadsRecordingAcrossFiles) {
  const auto all = messages({.wire = Wire::little});
  const auto half = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  const TemporaryFolder folder;
  ros::write_db3(folder / "a_0.db3", {all.begin(), half});
  write_text(folder / "a_1.mcap", ros::mcap({half, all.end()}, "cdr"));
  write_text(folder / "metadata.yaml",
             "rosbag2_bagfile_information:\n  relative_file_paths: [other/a_0.db3, a_1.mcap]\n");
  expect_all(folder.path());
}

TEST(RosSource, ReadsEveryEncodingOfDepth) {
  for (const char* encoding :
       {"16UC1", "mono16", "16UC1; compressedDepth png", "16UC1; compressedDepth rvl", "16UC1; png compressed "}) {
    SCOPED_TRACE(encoding);
    const InFile in(Settings{.depth_encoding = encoding});
    const auto frames = read(in.file);
    ASSERT_EQ(frames.size(), std::size_t{kFrames});
    for (std::size_t i = 0; i < kFrames; ++i) expect_depth(frames[i], i);
  }
  const InFile in(Settings{.depth_encoding = "32FC1"});
  EXPECT_EQ(read(in.file)[2].depth, images().frames[2].depth);
}

TEST(RosSource, ReadsEveryEncodingOfColor) {
  for (const char* encoding : {"rgb8", "bgr8", "rgba8", "bgra8", "rgb8; png compressed bgr8"}) {
    SCOPED_TRACE(encoding);
    const InFile in(Settings{.color_encoding = encoding});
    const auto frames = read(in.file);
    ASSERT_EQ(frames.size(), std::size_t{kFrames});
    for (std::size_t i = 0; i < kFrames; ++i) EXPECT_EQ(frames[i].color, images().color[i]);
  }
  const auto mean_error = [](const Frame& frame, std::size_t i, bool gray) {
    double sum = 0;
    for (std::size_t p = 0; p < frame.color.size(); ++p) {
      const std::uint32_t is = frame.color[p], was = images().color[i][p];
      const int r = was & 255, g = was >> 8 & 255, b = was >> 16 & 255;
      const int expected = gray ? static_cast<int>(std::lround(0.299 * r + 0.587 * g + 0.114 * b)) : g;
      sum += std::abs(static_cast<int>(is >> 8 & 255) - expected);
    }
    return sum / static_cast<double>(frame.color.size());
  };
  EXPECT_LT(mean_error(read(InFile(Settings{.color_encoding = "mono8"}).file)[3], 3, true), 1);
  constexpr double kOfJpeg = 4;  // gray levels out of 255
  EXPECT_LT(mean_error(read(InFile(Settings{.color_encoding = "rgb8; jpeg compressed bgr8"}).file)[3], 3, false),
            kOfJpeg);
}

TEST(RosSource, PairsNearestColorWithinHalfAFrame) {
  const InFile in(Settings{.color_every = 2});
  const auto frames = read(in.file);
  for (std::size_t i = 0; i < kFrames; ++i) EXPECT_EQ(frames[i].color.empty(), i % 2 == 1) << i;
}

TEST(RosSource, PairsByArrivalIfClocksDiffer) {
  const InFile in(Settings{.color_clock = -kBegin + 5'000'000'000});
  testing::internal::CaptureStdout();
  const auto frames = read(in.file);
  const std::string output = testing::internal::GetCapturedStdout();
  EXPECT_NE(output.find("the clocks of /camera/color/image_raw and /camera/depth/image_raw differ by 53.9 years"),
            std::string::npos)
      << output;
  EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1);
  for (std::size_t i = 0; i < kFrames; ++i) {
    EXPECT_EQ(frames[i].color, images().color[i]);
    EXPECT_NEAR(frames[i].color_delay, 1e-9 * kDelay, 1e-6);
  }
}

TEST(RosSource, SelectsRequestedOrLargestTopics) {
  auto all = messages();
  for (const ros::Recorded& m : ros::Messages(all))
    if (m.topic == "/camera/depth/image_raw" || m.topic == "/camera/depth/camera_info")
      all.push_back({"/b" + m.topic, m.type, m.time, m.bytes}),
          all.push_back({"/b" + m.topic, m.type, m.time, m.bytes});
  const InFile in("a.bag", bag(all));
  testing::internal::CaptureStdout();
  EXPECT_EQ(open_source(in.file)->size(), 2 * kFrames);
  const std::string output = testing::internal::GetCapturedStdout();
  EXPECT_NE(output.find("depth is read from the topic /b/camera/depth/image_raw"), std::string::npos) << output;
  EXPECT_NE(output.find("other topics: /camera/depth/image_raw"), std::string::npos) << output;
  EXPECT_EQ(open_source(in.file, {.depth_topic = "/camera/depth/image_raw"})->size(), kFrames);
  const auto topics = recorded_topics(in.file);
  EXPECT_EQ(
      std::count_if(topics.begin(), topics.end(), [](const auto& t) { return t.holds == RecordedTopic::Holds::depth; }),
      2);
}

TEST(RosSource, ProgramWarnsOnce) {
  auto all = messages();
  for (const ros::Recorded& m : ros::Messages(all))
    if (m.topic == "/camera/depth/image_raw") all.push_back({"/b" + m.topic, m.type, m.time, m.bytes});
  const InFile in("a.bag", bag(all));
  const Ran ran = run_cairn({"reconstruct", "--no-texture", in.file, "-o", in.folder / "map"});
  const std::string warning = "depth is read from the topic";
  const auto at = ran.err.find(warning);
  EXPECT_NE(at, std::string::npos) << ran.err;
  EXPECT_EQ(ran.err.find(warning, at + 1), std::string::npos) << ran.err;
}

TEST(RosSource, SelectsColorTopicNextToDepth) {
  auto all = messages();
  for (const ros::Recorded& m : ros::Messages(all))
    if (m.topic == "/camera/color/image_raw" || m.topic == "/camera/color/camera_info")
      for (int i = 0; i < 3; ++i) all.push_back({"/camera2/color" + m.topic.substr(13), m.type, m.time, m.bytes});
  const InFile in("a.bag", bag(all));
  testing::internal::CaptureStdout();
  (void)open_source(in.file);
  const std::string output = testing::internal::GetCapturedStdout();
  EXPECT_NE(output.find("color is read from the topic /camera/color/image_raw with 6 messages; other topics: "
                        "/camera2/color/image_raw"),
            std::string::npos)
      << output;
}

TEST(RosSource, HasOneCameraIfRegistered) {
  ros::Messages all;
  for (const ros::Recorded& m : messages({.tf = false, .color_every = 0})) all.push_back(m);
  for (int i = 0; i < kFrames; ++i) {
    auto rgba = images().frames[static_cast<std::size_t>(i)].color;
    all.push_back({"/camera/color/image_raw", "sensor_msgs/Image", kBegin + i * kStep + kLate,
                   image(Wire::ros1, {kBegin + i * kStep, "depth_optical", 64, 48, "rgba8", raw(rgba), 4})});
  }
  std::erase_if(all, [](const ros::Recorded& m) { return m.topic == "/camera/color/camera_info"; });
  all.push_back({"/camera/color/camera_info", "sensor_msgs/CameraInfo", kBegin,
                 camera_info(Wire::ros1, "depth_optical", kDepthCamera, "plumb_bob", {})});
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.time < b.time; });
  const InFile in("a.bag", bag(all));
  EXPECT_FALSE(open_source(in.file)->rig().color);
  EXPECT_EQ(read(in.file)[1].color, images().frames[1].color);
}

TEST(RosSource, ReadsLibrealsenseRecording) {
  ros::Messages all;
  const Eigen::Isometry3d identity = Eigen::Isometry3d::Identity();
  const std::string depth = "/device_0/sensor_0/Depth_0", color = "/device_0/sensor_1/Color_0",
                    gyro = "/device_0/sensor_2/Gyro_0", accel = "/device_0/sensor_2/Accel_0";
  const auto pose = [](const Eigen::Isometry3d& p) { return ros::MessageWriter(Wire::ros1).transform(p).bytes(); };
  const auto put = [&](const std::string& topic, const char* type, std::int64_t time, const std::string& bytes) {
    all.push_back({topic, type, time, bytes});
  };
  put("/device_0/info", "diagnostic_msgs/KeyValue", 1,
      ros::MessageWriter(Wire::ros1).text("Name").text("Intel RealSense D435I").bytes());
  put("/device_0/sensor_0/option/Depth_Units/value", "std_msgs/Float32", 1,
      ros::MessageWriter(Wire::ros1).put(0.0001f).bytes());
  put(depth + "/info/camera_info", "sensor_msgs/CameraInfo", 1,
      camera_info(Wire::ros1, "", kDepthCamera, "Brown Conrady", {0, 0, 0, 0, 0}));
  put(color + "/info/camera_info", "sensor_msgs/CameraInfo", 1,
      camera_info(Wire::ros1, "", kColorCamera.rectified(), "Inverse Brown Conrady", {0, 0, 0, 0, 0}));
  for (int i = 0; i < kFrames; ++i) {
    const std::int64_t stamp = kBegin + i * kStep, time = 1'000'000 + i * kStep;
    // Infrared images belong to the depth sensor and outnumber the depth images.
    for (int j = 0; j < 2; ++j)
      put("/device_0/sensor_0/Infrared_1/image/data", "sensor_msgs/Image", time,
          image(Wire::ros1, {stamp + j, "0", 64, 48, "8UC1", std::string(64 * 48, 'i'), 1}));
    auto units = millimeters(images().frames[static_cast<std::size_t>(i)], 10);
    put(depth + "/image/data", "sensor_msgs/Image", time,
        image(Wire::ros1, {stamp, "0", 64, 48, "mono16", raw(units), 2}));
    put(color + "/image/data", "sensor_msgs/Image", time, color_message({}, i, stamp));
    put(gyro + "/imu/data", "sensor_msgs/Imu", time, imu(Wire::ros1, stamp, "0", kRate, {0, 0, 0}));
    put(accel + "/imu/data", "sensor_msgs/Imu", time, imu(Wire::ros1, stamp, "0", {0, 0, 0}, kUp));
  }
  put(depth + "/tf/0", "geometry_msgs/Transform", 1, pose(identity));
  put(color + "/tf/0", "geometry_msgs/Transform", 1, pose(depth_from_color().inverse()));
  for (const auto& stream : {gyro, accel}) put(stream + "/tf/0", "geometry_msgs/Transform", 1, pose(identity));
  const InFile in("a.bag", bag(all, {.compression = "lz4"}));
  const Rig rig = open_source(in.file)->rig();
  EXPECT_EQ(rig.sensor, sensor_model("stereo"));
  ASSERT_TRUE(rig.color);
  EXPECT_EQ(rig.color->camera, kColorCamera.rectified());
  EXPECT_TRUE(rig.color->color_from_depth.isApprox(depth_from_color().inverse(), 1e-9));
  EXPECT_TRUE(rig.camera_from_imu);
  const auto frames = read(in.file);
  ASSERT_EQ(frames.size(), std::size_t{kFrames});
  for (std::size_t i = 0; i < kFrames; ++i) {
    ASSERT_FALSE(frames[i].problem) << *frames[i].problem;
    for (std::size_t p = 0; p < frames[i].depth.size(); ++p)
      ASSERT_NEAR(frames[i].depth[p], images().frames[i].depth[p], 0.51e-4);
    EXPECT_EQ(frames[i].color, images().color[i]);
    ASSERT_EQ(frames[i].gyro.size(), 1u);
    EXPECT_TRUE(frames[i].acceleration->isApprox(kUp));
  }
}

TEST(RosSource, KeepsGyroscopeOfSkippedFrames) {
  const InFile in(Settings{});
  const auto frames = read(in.file, {.range = {.begin = 1, .end = 6, .step = 2}});
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[1].index, 3);
  EXPECT_EQ(frames[0].gyro.size(), 4u);
  EXPECT_EQ(frames[1].gyro.size(), 8u);
}

TEST(RosSource, ReportsBadFrameAndContinues) {
  const InFile in(Settings{.bad_depth = 2});
  const auto frames = read(in.file);
  ASSERT_EQ(frames.size(), std::size_t{kFrames});
  ASSERT_TRUE(frames[2].problem);
  EXPECT_NE(frames[2].problem->find("a.bag: /camera/depth/image_raw in byte "), std::string::npos)
      << *frames[2].problem;
  EXPECT_NE(frames[2].problem->find("has 10 bytes"), std::string::npos) << *frames[2].problem;
  EXPECT_FALSE(frames[3].problem);
  EXPECT_EQ(frames[3].gyro.size(), 8u);  // includes samples of the unreadable frame
}

TEST(RosSource, DoubtsWrongUnit) {
  const InFile in(Settings{.depth_encoding = "16UC1", .meters_per_meter = 0.001});
  const auto source = open_source(in.file);
  const auto doubts = inspect(*source, kFrames).doubts;
  ASSERT_FALSE(doubts.empty());
  EXPECT_NE(doubts[0].find("factor of 1000"), std::string::npos) << doubts[0];
}

TEST(RosSource, UsesCameraFileWithoutCameraInfo) {
  const InFile in(Settings{.info = false, .tf = false});
  const Rig expected(kDepthCamera, ColorCamera{kColorCamera, depth_from_color().inverse()});
  write_rig(in.folder / "camera.yaml", expected);
  const auto source = open_source(in.file, {.camera = in.folder / "camera.yaml"});
  ASSERT_TRUE(source->rig().color);
  EXPECT_EQ(source->rig().depth, kDepthCamera);
  EXPECT_EQ(source->next()->color, images().color[0]);
}

TEST(RosSource, RejectsInvalidFilesInOneLine) {
  const auto expect_error = [](const InFile& in, const SourceOptions& options, const char* expected) {
    const auto error = error_of([&] { (void)open_source(in.file, options); });
    EXPECT_NE(error.find(in.file.filename().string()), std::string::npos) << error;
    EXPECT_NE(error.find(expected), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  };
  expect_error(InFile(Settings{.info = false}), {}, "no topic of sensor_msgs/CameraInfo for /camera/depth/image_raw");
  expect_error(InFile(Settings{}), {.depth_topic = "/camera/color/image_raw"},
               "the topic /camera/color/image_raw is not a depth topic, it has rgb8; image topics: ");
  expect_error(InFile(Settings{}), {.color_topic = "/camera/depth/image_raw"},
               "the topic /camera/depth/image_raw is not a color topic, it has 16UC1");
  expect_error(InFile(Settings{}), {.depth_topic = "/nothing"}, "has no topic /nothing (SourceOptions::depth_topic)");
  expect_error(InFile(Settings{.depth_encoding = "64FC1"}), {}, "no topic of depth images (16UC1, mono16, 32FC1");
  expect_error(InFile(Settings{.depth_encoding = "64FC1"}), {}, "/camera/depth/image_raw (64FC1)");
  for (const char* name : {"a.bag", "a.mcap", "a.db3"}) expect_error(InFile(name, ""), {}, "is empty");
  expect_error(InFile("a.bag", ros::bag({})), {}, "has no messages");
  expect_error(InFile("a.mcap", ros::mcap({}, "cdr")), {}, "has no messages");
  expect_error(InFile("a.bag", "#ROSBAG V1.2\n"), {}, "`rosbag fix`");
  expect_error(InFile("a.mcap", "nonsense"), {}, "does not start like an MCAP file");
  expect_error(InFile("a.db3", std::string(200, 'x')), {}, "is not a SQLite file");
  const TemporaryFolder folder;
  write_text(folder / "metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [a.db3.zstd]\n");
  EXPECT_NE(error_of([&] { (void)open_source(folder.path()); }).find("decompress it with `zstd -d`"),
            std::string::npos);
  write_text(folder / "metadata.yaml", "rosbag2_bagfile_information: [\n");
  EXPECT_NE(error_of([&] { (void)open_source(folder.path()); }).find("metadata.yaml: line "), std::string::npos);
  write_text(folder / "metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [.]\n");
  EXPECT_NE(error_of([&] { (void)open_source(folder.path()); }).find("lists the folder . as a file"),
            std::string::npos);
  EXPECT_NE(error_of([] { (void)open_source("nowhere.bag"); }).find("nowhere.bag"), std::string::npos);
}

/// The same messages in other file orders: reversed, grouped by topic, shuffled.
std::vector<ros::Messages> out_of_order(const ros::Messages& all) {
  ros::Messages backwards(all.rbegin(), all.rend()), by_topic = all, shuffled = all;
  std::stable_sort(by_topic.begin(), by_topic.end(), [](const auto& a, const auto& b) { return a.topic > b.topic; });
  std::mt19937 random(7);
  for (std::size_t i = shuffled.size(); i > 1; --i) std::swap(shuffled[i - 1], shuffled[random() % i]);
  return {backwards, by_topic, shuffled};
}

/// Arrival times of all messages in playback order, seconds.
std::vector<double> received(const std::filesystem::path& file) {
  const auto recording = open_ros_recording(file);
  std::vector<double> times;
  while (const auto message = recording->next()) times.push_back(message->received);
  return times;
}

/// Messages of the given size at whole seconds.
ros::Messages messages_at(const std::vector<int>& seconds, std::size_t bytes = 8) {
  ros::Messages all;
  for (const int second : seconds)
    all.push_back({"/a", "std_msgs/String", 1'000'000'000ll * second, std::string(bytes, '\0')});
  return all;
}

TEST(RosSource, PlaysBagsInTimeOrderByTheirIndex) {
  for (const auto& all : out_of_order(messages()))
    for (const char* compression : {"", "bz2", "lz4"})
      for (const std::size_t per_chunk : {1, 5, 1000}) {
        SCOPED_TRACE(fmt::format("{} {}", compression, per_chunk));
        expect_all(InFile("a.bag", bag(all, {.compression = compression, .per_chunk = per_chunk})).file);
      }
}

TEST(RosSource, PlaysMcapInTimeOrderByItsChunks) {
  for (const auto& all : out_of_order(messages({.wire = Wire::little})))
    for (const char* compression : {"", "lz4", "zstd"})
      for (const bool summary : {true, false}) {
        SCOPED_TRACE(fmt::format("{} {}", compression, summary));
        expect_all(InFile("a.mcap", mcap(all, "cdr", {.compression = compression, .summary = summary})).file);
      }
}

TEST(RosSource, PlaysRosbag2InTimeOrderWithAndWithoutAnIndex) {
  for (const auto& all : out_of_order(messages({.wire = Wire::little})))
    for (const bool indexed : {true, false}) {
      SCOPED_TRACE(indexed);
      const TemporaryFolder folder;
      write_db3(folder / "a.db3", all, {.indexed = indexed});
      expect_all(folder / "a.db3");
      const auto times = received(folder / "a.db3");
      EXPECT_EQ(times.size(), all.size());
      EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
    }
}

TEST(RosSource, MergesFilesOfAFolderByTheirTimes) {
  // Image files in reverse time order, and a third file with the other topics.
  const auto all = messages({.wire = Wire::little});
  ros::Messages images, others;
  for (const auto& m : all) (m.topic.find("image") != m.topic.npos ? images : others).push_back(m);
  const TemporaryFolder folder;
  const auto half = images.begin() + static_cast<std::ptrdiff_t>(images.size() / 2);
  write_text(folder / "a_0.mcap", ros::mcap({half, images.end()}, "cdr"));
  write_text(folder / "a_1.mcap", ros::mcap({images.begin(), half}, "cdr"));
  ros::write_db3(folder / "a_2.db3", others);
  write_text(folder / "metadata.yaml",
             "rosbag2_bagfile_information:\n  relative_file_paths: [a_0.mcap, a_1.mcap, a_2.db3]\n");
  expect_all(folder.path());
  const auto times = received(folder.path());
  EXPECT_EQ(times.size(), all.size());
  EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
}

TEST(RosSource, WarnsOfTooManyOverlappingFiles) {
  const TemporaryFolder folder;
  std::string names;
  constexpr int kFiles = 12;
  for (int i = 0; i < kFiles; ++i) {
    write_text(folder / fmt::format("{}.mcap", i), ros::mcap(messages_at({i, 100 + i}), "cdr"));
    names += fmt::format("{}{}.mcap", i > 0 ? ", " : "", i);
  }
  write_text(folder / "metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [" + names + "]\n");
  testing::internal::CaptureStdout();
  EXPECT_EQ(received(folder.path()).size(), std::size_t{2 * kFiles});
  const std::string output = testing::internal::GetCapturedStdout();
  EXPECT_NE(output.find("more than 8 of its files overlap in time"), std::string::npos) << output;
  EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1);
}

TEST(RosSource, KeepsFileOrderWithoutChunkTimes) {
  const std::vector<double> as_written{5, 6, 3, 4, 1, 2}, sorted{1, 2, 3, 4, 5, 6};
  const auto all = messages_at({5, 6, 3, 4, 1, 2});
  const ros::Packed unknown{.times = false, .per_chunk = 2}, known{.per_chunk = 2};
  EXPECT_EQ(received(InFile("a.bag", bag(all, unknown)).file), as_written);
  EXPECT_EQ(received(InFile("a.bag", bag(all, known)).file), sorted);
  EXPECT_EQ(received(InFile("a.mcap", mcap(all, "ros1", unknown)).file), as_written);
  EXPECT_EQ(received(InFile("a.mcap", mcap(all, "ros1", known)).file), sorted);
}

TEST(RosSource, KeepsTheOrderOfMessagesOfOneTime) {
  ros::Messages all;
  for (const std::uint8_t i : {9, 3, 7, 1, 8, 2})
    all.push_back(
        {"/a", "std_msgs/String", i < 7 ? 2'000'000'000 : 1'000'000'000, std::string(4, static_cast<char>(i))});
  for (const char* name : {"a.bag", "a.mcap", "a.db3"}) {
    SCOPED_TRACE(name);
    const InFile in(name,
                    std::string(name) == "a.bag" ? bag(all, {.per_chunk = 2}) : mcap(all, "ros1", {.per_chunk = 2}));
    if (std::string(name) == "a.db3") {
      std::filesystem::remove(in.file);
      write_db3(in.file, all, {.indexed = false});
    }
    const auto recording = open_ros_recording(in.file);
    std::vector<int> order;
    while (const auto message = recording->next()) order.push_back(message->bytes[0]);
    EXPECT_EQ(order, (std::vector<int>{9, 7, 8, 3, 1, 2}));
  }
}

TEST(RosSource, ReopensChunksBeyondMemoryLimit) {
  constexpr int kChunks = 16;
  constexpr std::size_t kBytes = 10 << 20;  // two per chunk: 320 MiB in total
  std::vector<int> seconds;
  for (int i = 0; i < kChunks; ++i) seconds.insert(seconds.end(), {i, 100 + i});
  const InFile in("a.mcap", mcap(messages_at(seconds, kBytes), "cdr", {.compression = "zstd", .per_chunk = 2}));
  testing::internal::CaptureStdout();
  const auto times = received(in.file);
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(times.size(), seconds.size());
  EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
}

TEST(RosSource, WarnsOfChunksBeyondMemoryLimit) {
  constexpr int kChunks = 16, kMessages = 10;
  constexpr std::size_t kBytes = 2 << 20;
  std::vector<int> seconds;
  for (int i = 0; i < kChunks; ++i)
    for (int k = 0; k < kMessages; ++k) seconds.push_back(kChunks * k + i);
  const ros::Packed packed{.compression = "lz4", .per_chunk = kMessages};
  for (const bool is_bag : {true, false}) {
    const auto all = messages_at(seconds, kBytes);
    const InFile in(is_bag ? "a.bag" : "a.mcap", is_bag ? bag(all, packed) : mcap(all, "cdr", packed));
    testing::internal::CaptureStdout();
    const auto times = received(in.file);
    const std::string output = testing::internal::GetCapturedStdout();
    EXPECT_EQ(times.size(), seconds.size());
    EXPECT_NE(output.find("overlap in time need more than 256 MiB"), std::string::npos) << output;
    EXPECT_NE(output.find(is_bag ? "`rosbag filter" : "`mcap sort"), std::string::npos) << output;
    EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1) << output;
  }
}

TEST(RosSource, ReadsAllMessagesDespiteWrongIndex) {
  std::string file = bag(messages_at({5, 6, 3, 4, 1, 2}), {.per_chunk = 2});
  const std::string field = "chunk_pos=";
  const std::size_t first = file.find(field) + field.size(), second = file.find(field, first) + field.size();
  file.replace(second, 8, file.substr(first, 8));
  testing::internal::CaptureStdout();
  EXPECT_EQ(received(InFile("a.bag", file).file), (std::vector<double>{5, 6, 3, 4, 1, 2}));
  const std::string output = testing::internal::GetCapturedStdout();
  EXPECT_NE(output.find("its index does not list all of them"), std::string::npos) << output;
}

TEST(RosSource, ContinuesAfterDamagedChunkOutOfOrder) {
  std::string file = bag(messages_at({5, 6, 3, 4, 1, 2}), {.compression = "lz4", .per_chunk = 2});
  file.replace(file.find("\x04\x22\x4d\x18"), 4, "****");
  const InFile in("a.bag", file);
  const auto recording = open_ros_recording(in.file);
  std::vector<double> times;
  int errors = 0;
  for (bool at_end = false; !at_end;) try {
      const auto message = recording->next();
      at_end = !message;
      if (message) times.push_back(message->received);
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find("is not an LZ4 frame"), std::string::npos) << error.what();
      ++errors;
    }
  EXPECT_EQ(times, (std::vector<double>{1, 2, 3, 4}));
  EXPECT_EQ(errors, 1);
}

TEST(RosSource, SortsDepthWithBackwardStamps) {
  auto all = messages();
  std::vector<std::size_t> depth;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i].topic == "/camera/depth/image_raw") depth.push_back(i);
  std::swap(all[depth[1]].bytes, all[depth[3]].bytes);
  std::swap(all[depth[2]].bytes, all[depth[5]].bytes);
  expect_all(InFile("a.bag", bag(all)).file);
}

TEST(RosSource, SortsNeighborsWithoutIndex) {
  for (const bool is_bag : {true, false}) {
    auto all = messages({.wire = is_bag ? Wire::ros1 : Wire::little});
    std::vector<std::size_t> depth;
    for (std::size_t i = 0; i < all.size(); ++i)
      if (all[i].topic == "/camera/depth/image_raw") depth.push_back(i);
    std::swap(all[depth[1]], all[depth[2]]);
    const ros::Packed packed{.indexed = false};
    const InFile in(is_bag ? "a.bag" : "a.mcap", is_bag ? bag(all, packed) : mcap(all, "cdr", packed));
    const auto frames = read(in.file);
    ASSERT_EQ(frames.size(), std::size_t{kFrames});
    for (std::size_t i = 0; i < kFrames; ++i) expect_depth(frames[i], i);
  }
}

TEST(RosSource, ReportsLateDepthImage) {
  Settings t{.imu = false, .color_every = 0};
  auto all = messages(t);
  const ros::Recorded late =
      *std::find_if(all.begin(), all.end(), [](const auto& m) { return m.topic.ends_with("image_raw"); });
  for (int i = kFrames; i < 3 * kFrames; ++i)
    all.push_back({t.depth_topic, late.type, kBegin + i * kStep, depth_message(t, i % kFrames, kBegin + i * kStep)});
  all.push_back({late.topic, late.type, kBegin + 3 * kFrames * kStep, late.bytes});
  const auto frames = read(InFile("a.bag", bag(all)).file);
  ASSERT_EQ(frames.size(), std::size_t{3 * kFrames + 1});
  const auto bad = std::find_if(frames.begin(), frames.end(), [](const Frame& f) { return f.problem.has_value(); });
  ASSERT_NE(bad, frames.end());
  EXPECT_NE(bad->problem->find("s before the previous frame"), std::string::npos);
  EXPECT_NE(bad->problem->find("it is skipped"), std::string::npos) << *bad->problem;
  EXPECT_EQ(std::count_if(frames.begin(), frames.end(), [](const Frame& f) { return f.problem.has_value(); }), 1);
}

TEST(RosSource, KeepsMessagesBeforeTruncation) {
  const auto expect_cut = [](const std::filesystem::path& file, const char* expected) {
    const auto source = open_source(file);
    EXPECT_FALSE(source->ended_early());
    std::size_t count = 0;
    for (; const auto frame = source->next(); ++count) expect_depth(*frame, count);
    EXPECT_GE(count, 2u);
    EXPECT_LT(count, std::size_t{kFrames});
    ASSERT_TRUE(source->ended_early());
    EXPECT_NE(source->ended_early()->find(expected), std::string::npos) << *source->ended_early();
    EXPECT_EQ(source->ended_early()->find('\n'), std::string::npos);
  };
  for (const char* compression : {"", "bz2", "lz4"}) {
    const std::string complete = bag(messages(), {.compression = compression});
    expect_cut(InFile("a.bag", complete.substr(0, complete.size() * 3 / 4)).file,
               "a.bag: is cut off or damaged in the record");
  }
  for (const char* compression : {"", "lz4", "zstd"}) {
    const std::string complete = mcap(messages({.wire = Wire::little}), "cdr", {.compression = compression});
    expect_cut(InFile("a.mcap", complete.substr(0, complete.size() * 3 / 4)).file, "a.mcap: is cut off or ");
  }
  const TemporaryFolder folder;
  write_db3(folder / "a.db3", messages({.wire = Wire::little}));
  const std::string complete = read_bytes(folder / "a.db3");
  write_text(folder / "a.db3", complete.substr(0, complete.size() * 3 / 4));
  expect_cut(folder / "a.db3", "a.db3: is cut off, ");
}

TEST(RosSource, ReadsUnfinishedBag) {
  const InFile in("a.bag", bag(messages(), {.indexed = false}));
  const auto source = open_source(in.file);
  EXPECT_FALSE(source->size());
  int count = 0;
  while (source->next()) ++count;
  EXPECT_EQ(count, kFrames);
  ASSERT_TRUE(source->ended_early());
  EXPECT_NE(source->ended_early()->find("has no index"), std::string::npos);
}

TEST(RosSource, ContinuesAfterDamagedChunk) {
  std::string file = bag(messages(), {.compression = "lz4"});
  const std::size_t third = file.find("\x04\x22\x4d\x18", file.find("\x04\x22\x4d\x18", file.size() / 3) + 1);
  file.replace(third, 4, "****");
  const InFile in("a.bag", file);
  const auto frames = read(in.file);
  int bad = 0, good = 0;
  for (const Frame& frame : frames) (frame.problem ? bad : good)++;
  EXPECT_EQ(bad, 1);
  EXPECT_GE(good, kFrames - 2);
  for (const Frame& frame : frames) {
    if (!frame.problem) continue;
    EXPECT_NE(frame.problem->find("is not an LZ4 frame"), std::string::npos) << *frame.problem;
  }
}

}  // namespace
}  // namespace cairn
