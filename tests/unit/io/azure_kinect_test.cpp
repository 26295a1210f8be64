// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/azure_kinect.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/io/source.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"
#include "support/videos.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Codec = MatroskaFile::Codec;
// Mean error over the image, out of 255.
constexpr double kJpegError = 4;   // loss of JPEG at quality 95 with chroma at half the resolution, for the room scene
constexpr double kDecoders = 1.5;  // between two decoders with different chroma upsampling

/// Calibration text in the sensor's format: depth has a distorted lens, color is 32 mm to the left and rotated by a
/// quarter turn about z, and the accelerometer's x is the depth camera's z, its y -x and its z -y.
std::string calibration_text(int color_sensor_height = 3072) {
  const auto camera = [](const char* place, const char* parameters, int width, int height, const char* rotation,
                         const char* translation) {
    return fmt::format(
        R"({{"Intrinsics": {{"ModelParameterCount": 14, "ModelParameters": [{}],
            "ModelType": "CALIBRATION_LensDistortionModelBrownConrady"}}, "Location": "CALIBRATION_CameraLocation{}",
            "MetricRadius": 1.74, "Rt": {{"Rotation": [{}], "Translation": [{}]}}, "SensorWidth": {},
            "SensorHeight": {}}})",
        parameters, place, rotation, translation, width, height);
  };
  return R"({"CalibrationInformation": {"Cameras": [)" +
         camera("D0", "0.5, 0.51, 0.49, 0.495, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0, 0, 0.002, 0.001", 1024, 1024,
                "1, 0, 0, 0, 1, 0, 0, 0, 1", "0, 0, 0") +
         ", " +
         camera("PV0", "0.51, 0.52, 0.48, 0.64, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0, 0, 0.004, 0.003", 4096,
                color_sensor_height, "0, -1, 0, 1, 0, 0, 0, 0, 1", "-0.032, -0.002, 0.004") +
         R"(], "InertialSensors": [{"SensorType": "CALIBRATION_InertialSensorType_Accelerometer",
             "Rt": {"Rotation": [0, 0, 1, -1, 0, 0, 0, -1, 0], "Translation": [-0.05, 0.003, 0.001]}},
             {"SensorType": "CALIBRATION_InertialSensorType_Gyro",
             "Rt": {"Rotation": [0, 0, 1, -1, 0, 0, 0, -1, 0], "Translation": [-0.05, 0.003, 0.001]}}]}})";
}

std::string as_b16g(const std::vector<float>& depth) {
  std::string bytes;
  for (const float z : depth) {
    const auto mm = static_cast<std::uint16_t>(std::lround(1000 * z));
    bytes += static_cast<char>(mm >> 8);
    bytes += static_cast<char>(mm & 0xff);
  }
  return bytes;
}

cv::Mat bgra(const std::vector<std::uint32_t>& color, int width, int height) {
  cv::Mat image;
  cv::cvtColor(cv::Mat(height, width, CV_8UC4, const_cast<std::uint32_t*>(color.data())), image, cv::COLOR_RGBA2BGRA);
  return image;
}

std::string as_jpeg(const std::vector<std::uint32_t>& color, int width, int height) {
  cv::Mat image;
  cv::cvtColor(bgra(color, width, height), image, cv::COLOR_BGRA2BGR);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 95});
  return {bytes.begin(), bytes.end()};
}

/// The JPEG of a 320x180 image, decoded by OpenCV.
std::vector<std::uint32_t> opencv_decoded(const std::vector<std::uint32_t>& color) {
  const std::string jpeg = as_jpeg(color, 320, 180);
  const cv::Mat image = cv::imdecode(std::vector<std::uint8_t>(jpeg.begin(), jpeg.end()), cv::IMREAD_COLOR);
  cv::Mat rgba;
  cv::cvtColor(image, rgba, cv::COLOR_BGR2RGBA);
  return {rgba.ptr<std::uint32_t>(), rgba.ptr<std::uint32_t>() + rgba.total()};
}

std::string as_inertial_sample(const Eigen::Vector3f& acceleration) {
  std::string bytes(40, '\0');
  std::memcpy(&bytes[8], acceleration.data(), 12);
  const Eigen::Vector3f rate = 0.1f * acceleration;
  std::memcpy(&bytes[28], rate.data(), 12);
  return bytes;
}

MatroskaFile recording_of(int depth_width, int depth_height, int color_width, int color_height) {
  MatroskaFile file;
  file.tracks = {{.tags = {{"title", "COLOR"}, {"K4A_COLOR_TRACK", "1"}, {"K4A_COLOR_MODE", "MJPG"}},
                  .codec = Codec::mjpeg,
                  .fourcc = {},
                  .width = color_width,
                  .height = color_height,
                  .rate = 10},
                 {.tags = {{"title", "DEPTH"}, {"K4A_DEPTH_TRACK", "2"}},
                  .fourcc = "b16g",
                  .width = depth_width,
                  .height = depth_height,
                  .rate = 10},
                 {.tags = {{"title", "IMU"}, {"K4A_IMU_TRACK", "3"}}, .codec = Codec::samples, .fourcc = {}}};
  file.tags = {{"K4A_DEPTH_DELAY_NS", "0"}};
  file.attachment_name = "calibration.json";
  file.attachment = calibration_text();
  file.packets = {{1, 0, "none"}};
  return file;
}

/// Four frames of the synthetic room at 10 Hz, in the smallest depth mode; color is 8 ms after depth.
struct Room {
  static constexpr int kFrames = 4;
  TemporaryFolder folder;
  std::vector<Frame> frames;  // ground truth, depth in whole mm
  MatroskaFile file = recording_of(320, 288, 320, 180);

  Room() {
    const Scene scene = synthetic_scene("room");
    file.packets.clear();
    for (int i = 0; i < kFrames; ++i) {
      const double time = 0.1 * i;
      Frame frame = scene_frame(scene, {320, 288, 250, 250, 160, 144, {}}, i);
      for (float& z : frame.depth) z = static_cast<float>(std::lround(1000 * z)) * 1e-3f;
      frame.color = scene_frame(scene, {320, 180, 250, 250, 160, 90, {}}, i).color;
      file.packets.push_back({1, time, as_b16g(frame.depth)});
      file.packets.push_back({0, time + 0.008, as_jpeg(frame.color, 320, 180)});
      // Up is -y of the depth camera and +z of the accelerometer; shaken along the accelerometer's x.
      for (int k = 1; k < 10; ++k)
        file.packets.push_back({2, time + 0.01 * k, as_inertial_sample({k % 2 == 0 ? 0.5f : -0.5f, 0.f, 9.81f})});
      frames.push_back(std::move(frame));
    }
  }
  [[nodiscard]] fs::path path() const { return folder / "a.mkv"; }
  [[nodiscard]] std::unique_ptr<Source> open() const {
    file.write(path());
    return open_source(path().string());
  }
};

double mean_difference(const std::vector<std::uint32_t>& a, const std::vector<std::uint32_t>& b) {
  const auto* p = reinterpret_cast<const std::uint8_t*>(a.data());
  const auto* q = reinterpret_cast<const std::uint8_t*>(b.data());
  double sum = 0;
  for (std::size_t i = 0; i < 4 * a.size(); ++i) sum += std::abs(p[i] - q[i]);
  return sum / (3.0 * static_cast<double>(a.size()));
}

TEST(AzureKinect, ReadsDepthColorTimesAndGravity) {
  const Room room;
  const auto source = room.open();
  for (int i = 0; i < Room::kFrames; ++i) {
    SCOPED_TRACE(i);
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    ASSERT_FALSE(frame->problem) << *frame->problem;
    EXPECT_EQ(frame->index, i);
    EXPECT_NEAR(frame->timestamp, 0.1 * i, 1e-9);
    EXPECT_NEAR(frame->color_delay, 0.008, 1e-9);
    const Frame& truth = room.frames[static_cast<std::size_t>(i)];
    ASSERT_EQ(frame->depth.size(), truth.depth.size());
    for (std::size_t k = 0; k < truth.depth.size(); ++k) ASSERT_NEAR(frame->depth[k], truth.depth[k], 1e-6);
    ASSERT_EQ(frame->color.size(), truth.color.size());
    EXPECT_LT(mean_difference(frame->color, truth.color), kJpegError);
    EXPECT_LT(mean_difference(frame->color, opencv_decoded(truth.color)), kDecoders);
    ASSERT_TRUE(frame->acceleration);
    EXPECT_NEAR(frame->acceleration->y(), -9.81, 1e-6);
    EXPECT_NEAR(frame->acceleration->z(), 0, 0.1);
    EXPECT_NEAR(frame->acceleration->x(), 0, 1e-6);
    ASSERT_EQ(frame->gyro.size(), i == 0 ? 0u : 9u);
    for (const AngularRate& sample : frame->gyro) {
      EXPECT_GT(sample.timestamp, frame->timestamp - 0.1);
      EXPECT_LE(sample.timestamp, frame->timestamp);
      const Eigen::Vector3d rate = *source->rig().camera_from_imu * sample.rate;  // rotated like the acceleration
      EXPECT_NEAR(rate.y(), -0.981, 1e-6);
      EXPECT_NEAR(std::abs(rate.z()), 0.05, 1e-6);
    }
  }
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(source->ended_early()) << *source->ended_early();
}

TEST(AzureKinect, SortsBlocksByTime) {
  const Room room;
  room.file.write(room.path());
  // Swaps clusters in time: the first tenth of a second with the second. Their times are milliseconds in one byte.
  std::string bytes = read_bytes(room.path());
  int moved = 0;
  for (std::size_t at = 0; (at = bytes.find("\x1f\x43\xb6\x75", at)) != bytes.npos; ++at) {
    const std::size_t time = bytes.find("\xe7\x81", at) + 2;
    ASSERT_LT(time, at + 20);
    const auto milliseconds = static_cast<std::uint8_t>(bytes[time]);
    if (milliseconds >= 200) break;
    bytes[time] = static_cast<char>(milliseconds < 100 ? milliseconds + 100 : milliseconds - 100);
    ++moved;
  }
  ASSERT_GE(moved, 2);
  write_text(room.path(), bytes);
  const auto source = open_source(room.path().string());
  for (int i = 0; i < Room::kFrames; ++i) {
    SCOPED_TRACE(i);
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    ASSERT_FALSE(frame->problem) << *frame->problem;
    EXPECT_NEAR(frame->timestamp, 0.1 * i, 1e-9);
    const std::size_t taken = i < 2 ? 1 - static_cast<std::size_t>(i) : static_cast<std::size_t>(i);
    EXPECT_NEAR(frame->depth[5000], room.frames[taken].depth[5000], 1e-6);
    EXPECT_FALSE(frame->color.empty());
    EXPECT_EQ(frame->gyro.size(), i == 0 ? 0u : 9u);
  }
}

TEST(AzureKinect, ReadsOnlyRequestedFrames) {
  const Room room;
  room.file.write(room.path());
  const auto source = open_source(room.path().string(), {.range = {.begin = 1, .end = 4, .step = 2}});
  EXPECT_EQ(source->next()->index, 1);
  EXPECT_EQ(source->next()->index, 3);
  EXPECT_FALSE(source->next());
}

// Same as transformation_get_mode_specific_*_camera_calibration of the sensor's SDK: the fraction times the calibrated
// image's size, minus the crop, minus half a pixel.
TEST(AzureKinect, ReadsCamerasOfEachMode) {
  struct Mode {
    int width, height;
    double sensor_width, sensor_height, left, top;
  };
  const TemporaryFolder folder;
  const auto rig = [&](const Mode& depth, const Mode& color, int sensor_height) {
    MatroskaFile file = recording_of(depth.width, depth.height, color.width, color.height);
    file.attachment = calibration_text(sensor_height);
    file.write(folder / "a.mkv");
    return open_azure_kinect(folder / "a.mkv")->rig();
  };
  const Mode depth_modes[] = {{320, 288, 512, 512, 96, 90},
                              {640, 576, 1024, 1024, 192, 180},
                              {512, 512, 512, 512, 0, 0},
                              {1024, 1024, 1024, 1024, 0, 0}};
  const Mode color_modes[] = {{1280, 720, 1280, 960, 0, 120},   {1920, 1080, 1920, 1440, 0, 180},
                              {2560, 1440, 2560, 1920, 0, 240}, {2048, 1536, 2048, 1536, 0, 0},
                              {3840, 2160, 3840, 2880, 0, 360}, {4096, 3072, 4096, 3072, 0, 0}};
  const auto expect = [](const Camera& c, const Mode& mode, double cx, double cy, double fx, double fy) {
    SCOPED_TRACE(fmt::format("{}x{}", mode.width, mode.height));
    EXPECT_EQ(c.width, mode.width);
    EXPECT_EQ(c.height, mode.height);
    EXPECT_NEAR(c.cx, cx * mode.sensor_width - mode.left - 0.5, 1e-9);
    EXPECT_NEAR(c.cy, cy * mode.sensor_height - mode.top - 0.5, 1e-9);
    EXPECT_NEAR(c.fx, fx * mode.sensor_width, 1e-9);
    EXPECT_NEAR(c.fy, fy * mode.sensor_height, 1e-9);
  };
  for (const Mode& mode : depth_modes) expect(rig(mode, color_modes[0], 3072).depth, mode, 0.5, 0.51, 0.49, 0.495);
  for (const Mode& mode : color_modes)
    expect(rig(depth_modes[0], mode, 3072).color->camera, mode, 0.51, 0.52, 0.48, 0.64);
  // Old calibrations use 16:9 images.
  expect(rig(depth_modes[0], color_modes[0], 2304).color->camera, {1280, 720, 1280, 720, 0, 0}, 0.51, 0.52, 0.48, 0.64);
  expect(rig(depth_modes[0], color_modes[3], 2304).color->camera, {2048, 1536, 2048, 1152, 0, -192}, 0.51, 0.52, 0.48,
         0.64);

  const Rig read = rig(depth_modes[1], color_modes[0], 3072);
  EXPECT_EQ(read.depth.distortion, (std::array{0.1, 0.2, 0.001, 0.002, 0.3, 0.4, 0.5, 0.6}));
  EXPECT_EQ(read.color->camera.distortion, (std::array{0.01, 0.02, 0.003, 0.004, 0.03, 0.04, 0.05, 0.06}));
  const Eigen::Vector3d point = read.color->color_from_depth * Eigen::Vector3d(1, 0, 2);
  EXPECT_TRUE(point.isApprox(Eigen::Vector3d(-0.032, 0.998, 2.004), 1e-9)) << point;
}

TEST(AzureKinect, PairsColorByConfiguredDelay) {
  Room room;
  room.file.tags["K4A_DEPTH_DELAY_NS"] = "80000000";
  room.file.packets.clear();
  for (int i = 0; i < 4; ++i) {
    const auto& frame = room.frames[static_cast<std::size_t>(i)];
    if (i != 2) room.file.packets.push_back({0, 0.1 * i, as_jpeg(frame.color, 320, 180)});
    room.file.packets.push_back({1, 0.1 * i + 0.08, as_b16g(frame.depth)});
  }
  const auto source = room.open();
  for (int i = 0; i < 4; ++i) {
    SCOPED_TRACE(i);
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->color.empty(), i == 2);
    if (i == 2) continue;
    EXPECT_NEAR(frame->color_delay, -0.08, 1e-9);
    EXPECT_LT(mean_difference(frame->color, room.frames[static_cast<std::size_t>(i)].color), kJpegError);
  }
}

TEST(AzureKinect, ReadsUncompressedColor) {
  Room room;
  auto& track = room.file.tracks[0];
  track.codec = Codec::raw;
  for (const std::string fourcc : {"BGRA", "NV12", "YUY2"}) {
    SCOPED_TRACE(fourcc);
    track.fourcc = fourcc;
    const Frame& truth = room.frames[0];
    const cv::Mat image = bgra(truth.color, 320, 180);
    std::string bytes(reinterpret_cast<const char*>(image.data), image.total() * 4);
    if (fourcc != "BGRA") {
      cv::Mat yuv;  // 4:2:0, planar
      cv::cvtColor(image, yuv, cv::COLOR_BGRA2YUV_I420);
      const char* p = reinterpret_cast<const char*>(yuv.data);
      const auto hue = [&](int plane, int x, int y) { return p[320 * 180 + plane * 160 * 90 + y / 2 * 160 + x / 2]; };
      bytes.assign(p, fourcc == "NV12" ? 320 * 180 : 0);
      for (int y = 0; y < 180; y += fourcc == "NV12" ? 2 : 1)
        for (int x = 0; x < 320; x += 2)
          if (fourcc == "NV12")
            bytes += {hue(0, x, y), hue(1, x, y)};
          else
            bytes += {p[320 * y + x], hue(0, x, y), p[320 * y + x + 1], hue(1, x, y)};
    }
    room.file.packets = {{0, 0, bytes}, {1, 0, as_b16g(truth.depth)}};
    const auto frame = room.open()->next();
    ASSERT_TRUE(frame);
    ASSERT_EQ(frame->color.size(), truth.color.size());
    EXPECT_LE(mean_difference(frame->color, truth.color), fourcc == "BGRA" ? 0 : kJpegError);
  }
}

TEST(AzureKinect, KeepsFramesBeforeTruncation) {
  const Room room;
  room.file.write(room.path());
  const std::string bytes = read_bytes(room.path());
  const std::string third = as_b16g(room.frames[2].depth);
  write_text(room.path(), bytes.substr(0, bytes.find(third) + third.size() / 2));
  const auto source = open_source(room.path().string());
  for (int i = 0; i < 2; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_FALSE(frame->problem);
    EXPECT_FALSE(frame->color.empty());
  }
  EXPECT_FALSE(source->next());
  ASSERT_TRUE(source->ended_early());
  EXPECT_EQ(*source->ended_early(), fmt::format("{}: is cut off, it has {} of its {} bytes", room.path().string(),
                                                fs::file_size(room.path()), bytes.size()));
}

TEST(AzureKinect, ReadsUnfinishedFile) {
  const Room room;
  room.file.write(room.path());
  std::string bytes = read_bytes(room.path());
  const std::size_t segment = bytes.find("\x18\x53\x80\x67");
  bytes.replace(segment + 4, 8, "\x01\xff\xff\xff\xff\xff\xff\xff");  // unknown size, as in an unfinished file
  const std::string last = as_b16g(room.frames[3].depth);
  write_text(room.path(), bytes.substr(0, bytes.find(last) + 100));
  const auto source = open_source(room.path().string());
  for (int i = 0; i < 3; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_FALSE(frame->problem);
  }
  EXPECT_FALSE(source->next());
}

TEST(AzureKinect, ReportsBadFrameAndContinues) {
  Room room;
  room.file.packets = {{1, 0.0, as_b16g(room.frames[0].depth)},
                       {0, 0.0, "no JPEG"},
                       {1, 0.1, as_b16g(room.frames[1].depth).substr(0, 1000)},
                       {1, 0.2, std::string(320 * 288 * 2, '\0')},
                       {1, 0.2, as_b16g(room.frames[2].depth)},
                       {1, 0.3, as_b16g(room.frames[3].depth)}};
  const auto source = room.open();
  const auto no_color = source->next();
  ASSERT_TRUE(no_color);
  EXPECT_FALSE(no_color->problem);
  EXPECT_TRUE(no_color->color.empty());
  for (const char* problem : {"cannot be decoded", "holds no measurement", "timestamp"}) {
    const auto frame = source->next();
    ASSERT_TRUE(frame && frame->problem) << problem;
    EXPECT_NE(frame->problem->find(problem), std::string::npos) << *frame->problem;
    EXPECT_NE(frame->problem->find("a.mkv: the depth image at byte "), std::string::npos) << *frame->problem;
    EXPECT_TRUE(frame->depth.empty());
  }
  EXPECT_FALSE(source->next()->problem);
}

TEST(AzureKinect, RejectsUnreadableFilesWithReason) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.mkv";
  const auto error = [&] { return error_of([&] { (void)open_source(path.string()); }); };
  EXPECT_NE(error().find("there is no such file"), std::string::npos);
  write_text(path, "");
  EXPECT_NE(error().find("a.mkv: is empty"), std::string::npos);
  write_text(path, "this is no video");
  EXPECT_NE(error().find("cut off or not a Matroska file"), std::string::npos);

  const MatroskaFile good = recording_of(320, 288, 320, 180);
  const auto expect = [&](const char* what, const std::function<void(MatroskaFile&)>& damage) {
    MatroskaFile bad = good;
    damage(bad);
    bad.write(path);
    const std::string message = error();
    EXPECT_NE(message.find(what), std::string::npos) << message;
    EXPECT_NE(message.find("a.mkv: "), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  };
  const auto swap = [](std::string from, std::string to) {
    return [from, to](MatroskaFile& f) { f.attachment.replace(f.attachment.find(from), from.size(), to); };
  };
  good.write(path);
  fs::resize_file(path, 300);
  EXPECT_NE(error().find("a.mkv: "), std::string::npos) << error();
  expect("has no depth track", [](MatroskaFile& f) { f.tracks[1].tags.clear(); });
  expect("its depth is encoded as mpeg4, expected 16-bit gray", [](MatroskaFile& f) {
    f.tracks[1].codec = Codec::mpeg4;
    f.tracks[1].fourcc.clear();
  });
  expect("calibration.json: is not among the attachments", [](MatroskaFile& f) { f.attachment_name.clear(); });
  expect("calibration.json: is not JSON", [](MatroskaFile& f) { f.attachment = "{"; });
  expect("key 'Cameras' not found", [](MatroskaFile& f) { f.attachment = R"({"CalibrationInformation": {}})"; });
  expect("no entry with the `Location` CALIBRATION_CameraLocationPV0", swap("LocationPV0", "LocationXX"));
  expect("the model 'CALIBRATION_LensDistortionModelTheta'", swap("ModelBrownConrady", "ModelTheta"));
  expect("center of distortion", swap("0, 0, 0.002", "0.1, 0, 0.002"));
  expect("`Rotation` is not a rotation", swap("0, -1, 0, 1, 0, 0", "0, -2, 0, 1, 0, 0"));
  expect("cx is", swap("0.5, 0.51, 0.49", "50, 0.51, 0.49"));
  expect("depth is 320x240, which is not a mode of the sensor", [](MatroskaFile& f) { f.tracks[1].height = 240; });
}

TEST(AzureKinect, ReadsARealRecording) {
  CAIRN_REQUIRE_DATA("azure/recording.mkv");
  const auto source = open_source((data_folder() / "azure/recording.mkv").string());
  const Rig& rig = source->rig();
  EXPECT_NEAR(rig.depth.fx, 504.608, 1e-3);
  EXPECT_NEAR(rig.depth.cy, 348.830, 1e-3);
  ASSERT_TRUE(rig.color);
  EXPECT_NEAR(rig.color->camera.cx, 639.304, 1e-3);
  EXPECT_NEAR(rig.color->camera.cy, 365.853, 1e-3);
  EXPECT_NEAR(rig.depth_from_color().translation().norm(), 0.0324, 1e-4);
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  EXPECT_FALSE(frame->problem);
  EXPECT_EQ(frame->color.size(), 1280u * 720u);
  EXPECT_EQ(frame->color_delay, 0);
  EXPECT_GT(std::count_if(frame->depth.begin(), frame->depth.end(), [](float z) { return z > 0.1f && z < 5; }), 200000);
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(source->ended_early());
}

}  // namespace
}  // namespace cairn
