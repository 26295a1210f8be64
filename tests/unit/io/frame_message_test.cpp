// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/sensors/frame_message.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <opencv2/core.hpp>
#include <tuple>

#include "base/image_file.hpp"
#include "support/files.hpp"
#include "support/frame_messages.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}
HelloMessage hello_of(const Json& json) { return read_hello(bytes_of(message_of(json))); }
FrameMessage frame_of(const Json& header, const std::string& data = small_depth(), const Json& hello = small_hello(),
                      const FrameOrder& before = {}) {
  return read_frame(bytes_of(message_of(header, data)), hello_of(hello), before);
}
template <class F>
void expect_error(F&& f, const std::string& what) {
  EXPECT_NE(error_of(std::forward<F>(f)).find(what), std::string::npos) << what << ", not " << error_of(f);
}
std::string text_of_png(const cv::Mat& image) {
  const auto png = encode_png(image);
  return {png.begin(), png.end()};
}
/// `value` at `key` of a copy.
Json with(Json json, const char* key, const Json& value) {
  json[key] = value;
  return json;
}

TEST(FrameMessage, HelloHasCamerasModelAndDepthUnit) {
  Json hello = small_hello();
  hello["camera"].update({{"depth_scale", 5000}, {"sensor", "stereo"}, {"distortion", {0.1, 0, 0, 0, 0}}});
  hello["camera"]["color"] = {{"width", 32},
                              {"height", 24},
                              {"fx", 30},
                              {"fy", 30},
                              {"cx", 15.5},
                              {"cy", 11.5},
                              {"translation", {0.1, 0, 0}},
                              {"rotation", {0, 0, 0, 1}}};
  hello["name"] = "phone";
  hello["poses"] = "opengl,mm";
  const HelloMessage read = hello_of(hello);
  EXPECT_EQ(read.depth_scale, 5000);
  EXPECT_EQ(read.rig.sensor, sensor_model("stereo"));
  EXPECT_EQ(read.rig.depth.distortion[0], 0.1);
  ASSERT_TRUE(read.rig.color);
  EXPECT_EQ(read.rig.color->camera.width, 32);
  EXPECT_EQ(read.rig.color->color_from_depth.translation().x(), 0.1);
  ASSERT_TRUE(read.poses);
  EXPECT_EQ(read.poses->scale, 0.001);
  EXPECT_EQ(read.name, "phone");
  EXPECT_EQ(hello_of(small_hello()).depth_scale, 1000);
}

TEST(FrameMessage, RefusesHellosWithTheFieldAndTheRemedy) {
  expect_error([] { (void)read_hello({}); }, "the message has 0 bytes");
  expect_error([] { (void)read_hello(bytes_of("GET / HTTP/1.1")); }, "the header's size is 542393671 bytes");
  expect_error([] { (void)read_hello(bytes_of(message_of(std::string("{\"cairn\": NaN}")))); }, "without NaN");
  expect_error([] { (void)read_hello(bytes_of(message_of(std::string(200, '[')))); }, "nested deeper");
  expect_error([] { (void)hello_of(with(small_hello(), "cairn", 2)); }, "not a hello of version 1");
  expect_error([] { (void)hello_of(with(small_hello(), "tokn", "a")); }, "'tokn' is not a key of the hello");
  expect_error([] { (void)hello_of(with(small_hello(), "camera", 1)); }, "`camera` is missing");
  expect_error([] { (void)hello_of(with(small_hello(), "poses", "up")); }, "'up' is unknown");
  expect_error([] { (void)hello_of(with(small_hello(), "token", std::string(101, 'a'))); }, "at most 100 characters");
  expect_error([] { (void)read_hello(bytes_of(message_of(small_hello(), "x"))); }, "1 bytes after its header");
  for (const auto& [key, value, what] : {std::tuple{"width", Json(0), "camera's width is 0"},
                                         {"width", Json(1e9), "camera: `width` takes an integer"},
                                         {"fx", Json(".nan"), "camera's fx is nan"},
                                         {"depth_scale", Json(0), "camera: depth_scale is 0"},
                                         {"sensor", Json("laser"), "camera: "}}) {
    Json hello = small_hello();
    hello["camera"][key] = value;
    expect_error([&] { (void)hello_of(hello); }, what);
  }
}

TEST(FrameMessage, RawAndEncodedImagesAreEqual) {
  cv::Mat depth(16, 16, CV_16UC1), color(16, 16, CV_8UC3), confidence(16, 16, CV_8UC1);
  for (int i = 0; i < 256; ++i) {
    depth.ptr<std::uint16_t>()[i] = static_cast<std::uint16_t>(i == 3 ? 0 : 700 + 5 * i);
    confidence.data[i] = static_cast<std::uint8_t>(i);
    for (int c = 0; c < 3; ++c) color.data[3 * i + c] = static_cast<std::uint8_t>(i + 50 * c);
  }
  std::string metric;
  for (int i = 0; i < 256; ++i) {
    const float z = static_cast<float>(depth.ptr<std::uint16_t>()[i]) * 0.001f;
    metric.append(reinterpret_cast<const char*>(&z), sizeof z);
  }
  const auto raw = [](const cv::Mat& image) {
    return std::string(reinterpret_cast<const char*>(image.data), image.total() * image.elemSize());
  };
  const auto read = [&](const std::string& depth_as, const std::string& d, const std::string& color_as,
                        const std::string& c, const std::string& confidence_as, const std::string& certain) {
    Json header = small_frame(0);
    header["depth"] = {{"format", depth_as}, {"bytes", d.size()}};
    header["color"] = {{"format", color_as}, {"bytes", c.size()}, {"delay", 0.01}};
    header["confidence"] = {{"format", confidence_as}, {"bytes", certain.size()}};
    return frame_of(header, d + c + certain).images;
  };
  const auto images = read("uint16", raw(depth), "rgb8", raw(color), "uint8", raw(confidence));
  const auto encoded = read("png", text_of_png(depth), "png", text_of_png(color), "png", text_of_png(confidence));
  const auto floats = read("float32", metric, "rgb8", raw(color), "uint8", raw(confidence));
  EXPECT_EQ(images.depth[3], 0.0f);
  EXPECT_FLOAT_EQ(images.depth[1], 0.705f);
  EXPECT_EQ(images.color[1], 0xff653301u);
  EXPECT_EQ(images.color_delay, 0.01);
  EXPECT_EQ(images.confidence[255], 255);
  EXPECT_EQ(encoded.depth, images.depth);
  EXPECT_EQ(encoded.color, images.color);
  EXPECT_EQ(encoded.confidence, images.confidence);
  EXPECT_EQ(floats.depth, images.depth);
}

TEST(FrameMessage, PosesAndMotionAreConvertedToTheCamera) {
  Json hello = small_hello(), header = small_frame(1);
  hello["poses"] = "opengl,mm";
  hello["camera"]["imu"]["rotation"] = {0, 0, 1, 0};  // half a turn around z
  header["pose"] = {1000, 2000, 3000, 0, 0, 0, 1};
  header["gyro"] = header["accel"] = Json::array({{0.01, 1, 2, 3}});
  const SensorImages images = frame_of(header, small_depth(), hello).images;
  ASSERT_TRUE(images.guess);
  EXPECT_TRUE(images.guess->translation().isApprox(Eigen::Vector3d(1, 2, 3)));
  EXPECT_TRUE(images.guess->linear().isApprox(Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix()));
  ASSERT_EQ(images.rates.size(), 1u);
  EXPECT_EQ(images.rates[0].rate, Eigen::Vector3d(1, 2, 3));
  ASSERT_EQ(images.accelerations.size(), 1u);
  EXPECT_TRUE(images.accelerations[0].value.isApprox(Eigen::Vector3d(-1, -2, 3)));
}

TEST(FrameMessage, RefusesFramesWithTheFieldAndTheRemedy) {
  const auto refuses = [](const char* key, const Json& value, const std::string& what) {
    expect_error([&] { (void)frame_of(with(small_frame(0), key, value)); }, what);
  };
  refuses("frame", -1, "`frame` is not a number from 0");
  refuses("frame", 1.5, "`frame` is not a number from 0");
  refuses("time", "now", "`time` is not a number");
  refuses("time", 1e300, "`time` has 1e+300");
  refuses("colour", 1, "'colour' is not a key of the frame");
  refuses("depth", Json(), "`depth` is missing");
  refuses("depth", {{"format", "zip"}, {"bytes", 512}}, "depth: format 'zip' is unknown: use png, uint16, float32");
  refuses("depth", {{"format", "uint16"}, {"bytes", 0}}, "depth: `bytes` is 0, allowed: 1 to the 512");
  refuses("depth", {{"format", "uint16"}, {"bytes", 513}}, "depth: `bytes` is 513");
  refuses("depth", {{"format", "uint16"}, {"bytes", std::uint64_t{1} << 63}}, "depth: `bytes` is 9223372036854775808");
  refuses("depth", {{"format", "uint16"}, {"bytes", 510}}, "2 bytes follow the last part");
  refuses("depth", {{"format", "float32"}, {"bytes", 512}}, "the camera of 16x16 needs 1024");
  refuses("depth", {{"format", "png"}, {"bytes", 512}}, "depth: its bytes are not png");
  refuses("color", {{"format", "rgb8"}, {"bytes", 768}}, "color: `bytes` is 768, allowed: 1 to the 0");
  refuses("pose", {0, 0, 0, 0, 0, 0, 2}, "`pose` has 2");
  refuses("pose", {0, 0, 0, 0, 0, 0, 0.5}, "`pose`: its quaternion has length 0.5");
  refuses("pose", {0, 0, 0}, "`pose` takes tx ty tz qx qy qz qw");
  refuses("gyro", {{0, 1, 2}}, "`gyro` takes [time, x, y, z]");
  refuses("cairn", 1, "a second hello");
  expect_error(
      [] {
        (void)frame_of(with(small_frame(0), "pose", {0, 0, 0, 0, 0, 0, 1}), small_depth(),
                       with(small_hello(), "poses", false));
      },
      "the hello announced no poses");
  Json hello = small_hello(), header = with(small_frame(0), "accel", Json::array({{0, 1, 2, 3}}));
  hello["camera"].erase("imu");
  expect_error([&] { (void)frame_of(header, small_depth(), hello); }, "`imu` in the hello's camera");
  header.erase("time");
  expect_error([&] { (void)frame_of(header); }, "need `time`");
}

TEST(FrameMessage, RefusesImagesOfAnotherSizeAndKind) {
  for (const auto& [image, what] :
       {std::pair{cv::Mat(8, 16, CV_16UC1, cv::Scalar(1)), "depth: is 16x8, the camera 16x16"},
        {cv::Mat(16, 16, CV_8UC1, cv::Scalar(1)), "depth: the PNG is not gray of 16 bits"}}) {
    const std::string png = text_of_png(image);
    const Json header = with(small_frame(0), "depth", {{"format", "png"}, {"bytes", png.size()}});
    expect_error([&] { (void)frame_of(header, png); }, what);
    expect_error([&] { (void)frame_of(header, png.substr(0, 40) + std::string(png.size() - 40, 'x')); }, "depth: ");
  }
}

TEST(FrameMessage, RefusesDepthThatIsNotFinite) {
  for (const float z : {NAN, INFINITY, -1.0f}) {
    std::string depth(1024, '\0');
    std::memcpy(&depth[4 * 35], &z, sizeof z);
    expect_error(
        [&] {
          (void)frame_of(with(small_frame(0), "depth", {{"format", "float32"}, {"bytes", 1024}}), depth);
        },
        "at pixel 3, 2: send meters, and 0 without a measurement");
  }
}

TEST(FrameMessage, NumbersAndTimesIncrease) {
  const auto after = [](const Json& header, const FrameOrder& before) {
    return frame_of(header, small_depth(), small_hello(), before);
  };
  EXPECT_EQ(after(small_frame(5), {.number = 4, .timestamp = 0.1}).images.number, 5);
  expect_error([&] { (void)after(small_frame(5), {.number = 5, .timestamp = 0.1}); }, "`frame` is 5 after 5");
  expect_error([&] { (void)after(small_frame(6), {.number = 5, .timestamp = 0.2}); }, "`time` is 0.2 after 0.2");
  expect_error([&] { (void)after(small_frame(6), {.number = 5, .timestamp = {}}); }, "`time` is in some frames only");
  Json header = small_frame(6);
  header.erase("time");
  expect_error([&] { (void)after(header, {.number = 5, .timestamp = 0.1}); }, "`time` is in some frames only");
  EXPECT_FALSE(after(header, {.number = 5, .timestamp = {}}).has_timestamp);
}

TEST(FrameMessage, EndHasNoImages) {
  EXPECT_TRUE(frame_of({{"end", true}}, "").is_end);
  EXPECT_FALSE(frame_of(small_frame(0)).is_end);
}

}  // namespace
}  // namespace cairn
