// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The messages of ROS that recordings of cameras hold, from their bytes to values. Each function throws
// std::runtime_error, without file and topic, for bytes that are no such message.
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/image_file.hpp"
#include "cairn/camera.hpp"
#include "io/ros_recording.hpp"

namespace cairn {

struct RosHeader {
  double stamp = 0;      // seconds; 0: none
  std::string frame_id;  // without a slash before it
};
/// The header that a message of many types begins with.
[[nodiscard]] RosHeader read_ros_header(std::span<const std::uint8_t> bytes, RosEncoding encoding);

/// An image, decoded where it is packed, in the pixels that it was recorded with.
struct RosImage {
  enum class Kind { depth, colour, grey, other };
  Kind kind = Kind::other;
  std::string encoding;             // as a user knows it
  cv::Mat pixels;                   // may lie in the message's bytes; of pairs of pixels a whole number in a row
  int width = 0;                    // of the image
  bool packed_from_metres = false;  // depth in metres that was packed into 16 bits, with the next two numbers
  float quant_a = 0, quant_b = 0;
  int to_rgba = -1;  // cv::ColorConversionCodes; -1: it is
};
/// `type`: sensor_msgs/Image or sensor_msgs/CompressedImage. Throws std::runtime_error for an image beyond `bound`,
/// before it is decoded.
[[nodiscard]] RosImage read_ros_image(std::span<const std::uint8_t> bytes, RosEncoding encoding, std::string_view type,
                                      const ImageBound& bound = {});
/// Metres; 0 where nothing was measured. `unit`: metres, of depth in whole numbers.
[[nodiscard]] std::vector<float> depth_of(const RosImage& image, double unit);
/// Bytes R, G, B, 255.
[[nodiscard]] std::vector<std::uint32_t> colour_of(const RosImage& image);

/// A sensor_msgs/CameraInfo.
struct RosCameraInfo {
  RosHeader header;
  int width = 0, height = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k{};
  std::array<double, 12> p{};
  std::uint32_t binning_x = 0, binning_y = 0, left = 0, top = 0, roi_width = 0, roi_height = 0;
};
[[nodiscard]] RosCameraInfo read_camera_info(std::span<const std::uint8_t> bytes, RosEncoding encoding);
/// The camera of raw or of rectified images. Throws for a lens that Camera cannot be.
[[nodiscard]] Camera camera_of(const RosCameraInfo& info, bool rectified);

/// A sensor_msgs/Imu.
struct RosImu {
  std::optional<Eigen::Vector3d> rate, acceleration;  // rad/s, m/s^2
};
[[nodiscard]] RosImu read_imu(std::span<const std::uint8_t> bytes, RosEncoding encoding);

struct RosTransform {
  std::string parent, child;  // frames
  Eigen::Isometry3d parent_from_child = Eigen::Isometry3d::Identity();
};
/// A tf2_msgs/TFMessage or tf/tfMessage.
[[nodiscard]] std::vector<RosTransform> read_tf(std::span<const std::uint8_t> bytes, RosEncoding encoding);
/// A geometry_msgs/Transform.
[[nodiscard]] Eigen::Isometry3d read_transform(std::span<const std::uint8_t> bytes, RosEncoding encoding);
/// A std_msgs/Float32.
[[nodiscard]] float read_float(std::span<const std::uint8_t> bytes, RosEncoding encoding);
/// A diagnostic_msgs/KeyValue.
[[nodiscard]] std::pair<std::string, std::string> read_key_value(std::span<const std::uint8_t> bytes,
                                                                 RosEncoding encoding);

}  // namespace cairn
