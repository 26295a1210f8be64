// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/ros_messages.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "io/datasets/rvl.hpp"
#include "support/files.hpp"
#include "support/ros_files.hpp"

namespace cairn {
namespace {

using ros::Wire;
constexpr Wire kWires[] = {Wire::ros1, Wire::little, Wire::big};
const Camera kCamera{640, 480, 600, 601, 319.5, 239.5, {}};

std::span<const std::uint8_t> span_of(const std::string& bytes) {
  return {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()};
}
RosEncoding encoding_of(Wire wire) { return wire == Wire::ros1 ? RosEncoding::ros1 : RosEncoding::cdr; }

Camera camera_told(const std::string& model, const std::vector<double>& d, bool rectified = false) {
  const std::string bytes = camera_info(Wire::little, "frame", kCamera, model, d);
  return camera_of(read_camera_info(span_of(bytes), RosEncoding::cdr), rectified);
}

TEST(RosMessages, AlignNumbersAfterTextOfAnyLength) {
  for (const Wire wire : kWires)
    for (const char* frame : {"", "a", "ab", "abc", "abcd", "/abcde", "abcdef", "abcdefg"}) {
      SCOPED_TRACE(frame);
      const std::string expected = *frame == '/' ? frame + 1 : frame;
      std::string bytes = camera_info(wire, frame, kCamera, "plumb_bob", {0.1, 0.2, 0.3, 0.4, 0.5});
      const RosCameraInfo info = read_camera_info(span_of(bytes), encoding_of(wire));
      EXPECT_EQ(info.header.frame_id, expected);
      EXPECT_EQ(info.header.stamp, 1);
      EXPECT_EQ(camera_of(info, false).distortion, (std::array<double, 8>{0.1, 0.2, 0.3, 0.4, 0.5}));
      bytes = imu(wire, 1'500'000'000, frame, {1, 2, 3}, {4, 5, 6});
      EXPECT_EQ(read_ros_header(span_of(bytes), encoding_of(wire)).stamp, 1.5);
      EXPECT_EQ(*read_imu(span_of(bytes), encoding_of(wire)).acceleration, Eigen::Vector3d(4, 5, 6));
      Eigen::Isometry3d pose(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()));
      pose.translation().y() = 2;
      bytes = tf(wire, {{"a", frame, pose}, {frame, "b", pose.inverse()}});
      const auto transforms = read_tf(span_of(bytes), encoding_of(wire));
      ASSERT_EQ(transforms.size(), 2u);
      EXPECT_EQ(transforms[0].child, expected);
      EXPECT_TRUE(transforms[1].parent_from_child.isApprox(pose.inverse(), 1e-12));
    }
}

TEST(RosMessages, ReadEachLensModel) {
  EXPECT_FALSE(camera_told("plumb_bob", {}).distorted());
  EXPECT_FALSE(camera_told("None", {0, 0, 0, 0, 0}).distorted());
  EXPECT_EQ(camera_told("rational_polynomial", {1, 2, 3, 4, 5, 6, 7, 8}).distortion,
            (std::array<double, 8>{1, 2, 3, 4, 5, 6, 7, 8}));
  const Camera fisheye = camera_told("equidistant", {0.1, 0.2, 0.3, 0.4});
  EXPECT_EQ(fisheye.lens, Lens::fisheye);
  EXPECT_EQ(fisheye.distortion, (std::array<double, 8>{0.1, 0.2, 0.3, 0.4}));
  // P has twice the focal length of K, and rectified images have no distortion.
  const Camera rectified = camera_told("plumb_bob", {0.1, 0, 0, 0, 0}, true);
  EXPECT_EQ(rectified.fx, 1200);
  EXPECT_FALSE(rectified.distorted());
  EXPECT_NE(error_of([] { (void)camera_told("thin_prism", {1, 2, 3, 4}); }).find("'thin_prism'"), std::string::npos);
  EXPECT_NE(error_of([] { (void)camera_told("equidistant", {1}); }).find("1 coefficients"), std::string::npos);
}

TEST(RosMessages, InvertLibrealsenseDistortion) {
  const double k1 = -0.055, k2 = 0.065, p1 = 0.0004, p2 = -0.0002, k3 = -0.021;  // similar to a D455
  const Camera camera = camera_told("Inverse Brown Conrady", {k1, k2, p1, p2, k3});
  constexpr double kOfTheFit = 0.02;  // pixels, error of the fit
  for (const double u : {0.0, 160.0, 320.0, 500.0, 639.0})
    for (const double v : {0.0, 100.0, 240.0, 479.0}) {
      const double x = (u - camera.cx) / camera.fx, y = (v - camera.cy) / camera.fy, r2 = x * x + y * y;
      const double f = 1 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
      const Eigen::Vector2d ray(x * f + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                                y * f + 2 * p2 * x * y + p1 * (r2 + 2 * y * y));
      const Eigen::Vector2d seen = camera.distort(ray);
      EXPECT_NEAR(seen.x() * camera.fx + camera.cx, u, kOfTheFit);
      EXPECT_NEAR(seen.y() * camera.fy + camera.cy, v, kOfTheFit);
    }
}

TEST(RosMessages, ApplyRegionOfInterestAndBinning) {
  RosCameraInfo info{.width = 640, .height = 480};
  info.k = {600, 0, 319.5, 0, 600, 239.5, 0, 0, 1};
  info.left = 100, info.top = 40, info.roi_width = 400, info.roi_height = 320;
  info.binning_x = info.binning_y = 2;
  const Camera camera = camera_of(info, false);
  EXPECT_EQ(camera, (Camera{200, 160, 300, 300, 109.5, 99.5, {}}));
}

TEST(RosMessages, DetectUnmeasuredInertialValues) {
  const std::string bytes = imu(Wire::ros1, 1, "imu", {0, 0, 0}, {1, 2, 3});
  const RosImu imu = read_imu(span_of(bytes), RosEncoding::ros1);
  EXPECT_FALSE(imu.rate);
  EXPECT_TRUE(imu.acceleration);
}

TEST(RosMessages, RejectTruncatedBytes) {
  for (const Wire wire : kWires) {
    const std::string info = camera_info(wire, "frame", kCamera, "plumb_bob", {0, 0, 0, 0, 0});
    for (std::size_t size = 0; size + 1 < info.size(); size += 7)
      EXPECT_EQ(error_of([&] { (void)read_camera_info(span_of(info).first(size), encoding_of(wire)); }),
                "ends too early");
    const std::string gray = image(wire, {1, "frame", 4, 4, "16UC1", std::string(31, 'x'), 2});
    const auto read = [&] { (void)read_ros_image(span_of(gray), encoding_of(wire), "sensor_msgs/Image"); };
    EXPECT_EQ(error_of(read), "is an image of 4x4 pixels as 16UC1 with 8 bytes per row, but has 31 bytes");
  }
  const std::string parameters("\0\3\0\0more", 8);
  EXPECT_NE(error_of([&] { (void)read_ros_header(span_of(parameters), RosEncoding::cdr); }).find("CDR of a kind"),
            std::string::npos);
}

TEST(RosMessages, DecodeInverseDepth) {
  // compressed_depth_image_transport: z = a / (value - b)
  const float a = 500, b = 3;
  std::string front(12, '\0');
  std::memcpy(front.data() + 4, &a, 4);
  std::memcpy(front.data() + 8, &b, 4);
  cv::Mat units(16, 16, CV_16UC1, cv::Scalar(253));
  units.at<std::uint16_t>(0, 0) = 0;
  std::vector<std::uint8_t> png;
  cv::imencode(".png", units, png);
  const std::string bytes = compressed_image(Wire::ros1, 1, "frame", "32FC1; compressedDepth png",
                                             front + std::string(png.begin(), png.end()));
  const auto depth = depth_of(read_ros_image(span_of(bytes), RosEncoding::ros1, "sensor_msgs/CompressedImage"), 1e-3);
  EXPECT_EQ(depth[0], 0);
  EXPECT_EQ(depth[1], 2);
}

TEST(RosMessages, DecodeRvl) {
  // Encoded by hand: 2 zeros, 2 nonzeros, +5 as 10 = 1 010 in two groups, +1 as 2.
  const auto unpacked = [](const std::string& bytes, std::size_t pixels) { return decode_rvl(span_of(bytes), pixels); };
  const std::string by_hand("\x00\x20\xa1\x22", 4);
  EXPECT_EQ(unpacked(by_hand, 4), (std::vector<std::uint16_t>{0, 0, 5, 6}));
  EXPECT_NE(error_of([&] { (void)unpacked(by_hand, 3); }).find("more pixels than the image"), std::string::npos);
  EXPECT_NE(error_of([&] { (void)unpacked(by_hand, 9); }).find("cut off"), std::string::npos);
  EXPECT_NE(error_of([&] { (void)unpacked(std::string(100, '\xff'), 9); }).find("damaged"), std::string::npos);
  std::vector<std::uint16_t> depth(16 * 20);
  for (std::size_t i = 0; i < depth.size(); ++i)
    depth[i] = static_cast<std::uint16_t>(i % 7 == 0 ? 0 : i % 11 == 0 ? 65535 : 100 * i);
  const auto image_of = [&](std::size_t size) {
    const std::string bytes =
        compressed_image(Wire::ros1, 1, "frame", "16UC1; compressedDepth rvl", ros::rvl(depth, 16).substr(0, size));
    return read_ros_image(span_of(bytes), RosEncoding::ros1, "sensor_msgs/CompressedImage");
  };
  const RosImage image = image_of(std::string::npos);
  EXPECT_EQ(image.kind, RosImage::Kind::depth);
  EXPECT_EQ(image.pixels.size(), cv::Size(16, 20));
  EXPECT_TRUE(std::equal(depth.begin(), depth.end(), image.pixels.begin<std::uint16_t>()));
  for (const std::size_t size : {5, 15, 21, 300}) EXPECT_THROW((void)image_of(size), std::runtime_error) << size;
}

TEST(RosMessages, DecodeYuvOfOddWidth) {
  // 17 pixels: nine pairs; the second pixel of the last pair is outside of the image.
  constexpr int kWidth = 17, kHeight = 16;
  for (const char* encoding : {"yuv422", "uyvy", "yuv422_yuy2", "yuyv"}) {
    SCOPED_TRACE(encoding);
    const bool is_uyvy = encoding[0] == 'u' || encoding == std::string("yuv422");
    std::string rows;
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth + 1; ++x) {
        const char brightness = static_cast<char>(x < kWidth ? 0x7e : 0x10);
        rows += is_uyvy ? std::string{'\x80', brightness} : std::string{brightness, '\x80'};
      }
    const auto read = [&](int more_per_row, const std::string& data) {
      const std::string bytes =
          image(Wire::ros1, {1, "frame", kWidth, kHeight, encoding, data, 2, false, more_per_row});
      return read_ros_image(span_of(bytes), RosEncoding::ros1, "sensor_msgs/Image");
    };
    const RosImage padded = read(2, rows);
    EXPECT_EQ(padded.width, kWidth);
    const auto color = color_of(padded);
    ASSERT_EQ(color.size(), std::size_t{kWidth * kHeight});
    for (const std::uint32_t pixel : color) EXPECT_EQ(pixel, 0xff808080u);
    const std::string tight(std::size_t{2 * kWidth * kHeight}, '\x80');
    EXPECT_NE(error_of([&] { (void)read(0, tight); }).find("a row of odd width needs two more bytes"),
              std::string::npos);
  }
}

TEST(RosMessages, RejectSizesBeyondTheirBytes) {
  const auto error = [](const ros::ImageMessage& m, const ImageBound& bound = {}) {
    const std::string bytes = image(Wire::ros1, m);
    return error_of([&] { (void)read_ros_image(span_of(bytes), RosEncoding::ros1, "sensor_msgs/Image", bound); });
  };
  EXPECT_NE(error({1, "frame", 1 << 20, 1 << 20, "16UC1", "few", 2}).find("allowed: 1 to 4096 per side"),
            std::string::npos);
  EXPECT_NE(error({1, "frame", -1, -1, "rgb8", "few", 3}).find("allowed: 1 to 4096 per side"), std::string::npos);
  EXPECT_NE(error({1, "frame", 4096, 4096, "rgb8", "few", 3}).find("but has 3 bytes"), std::string::npos);
  EXPECT_NE(error({1, "frame", 16, 16, "16UC1", std::string(16 * 33, 'x'), 2, false, 1}).find("not a multiple"),
            std::string::npos);
  EXPECT_NE(error({1, "frame", 3, 2, "bayer_rggb8", std::string(6, 'x'), 1}).find("too small for its color pattern"),
            std::string::npos);
  EXPECT_EQ(error({1, "frame", 16, 16, "mono8", std::string(256, 'x'), 1}, {.size = {64, 48}}),
            "is 16x16, the camera 64x48");
  // RVL image with a larger size than its data.
  std::string rvl(8, '\0');
  rvl[3] = rvl[7] = '\x40';
  const std::string bytes =
      compressed_image(Wire::ros1, 1, "frame", "16UC1; compressedDepth rvl", std::string(12, '\0') + rvl);
  EXPECT_NE(error_of([&] {
              (void)read_ros_image(span_of(bytes), RosEncoding::ros1, "sensor_msgs/CompressedImage");
            }).find("allowed: 1 to 4096 per side"),
            std::string::npos);
}

TEST(RosMessages, DecodeYuvAndBayer) {
  // Gray image in each encoding: UYVY and YUYV have luma in every second byte, Bayer in every byte.
  const auto color_in = [](const char* encoding, const std::string& data, int size) {
    const std::string bytes = image(Wire::ros1, {1, "frame", 16, 16, encoding, data, size});
    return color_of(read_ros_image(span_of(bytes), RosEncoding::ros1, "sensor_msgs/Image"));
  };
  std::string uyvy, yuyv;
  for (int i = 0; i < 256; ++i) uyvy += "\x80\x7e", yuyv += "\x7e\x80";
  const auto from_uyvy = color_in("yuv422", uyvy, 2), from_yuyv = color_in("yuv422_yuy2", yuyv, 2);
  EXPECT_EQ(from_uyvy, from_yuyv);
  EXPECT_EQ(from_uyvy[40], 0xff808080u);
  EXPECT_EQ(color_in("bayer_rggb8", std::string(256, '\x7f'), 1)[40], 0xff7f7f7fu);
  // Red is the upper left of each 2x2 pixels.
  std::string red;
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 16; ++x) red += x % 2 == 0 && y % 2 == 0 ? '\xff' : '\0';
  EXPECT_EQ(color_in("bayer_rggb8", red, 1)[6 * 16 + 6], 0xff0000ffu);
}

}  // namespace
}  // namespace cairn
