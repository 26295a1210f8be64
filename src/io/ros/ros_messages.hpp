// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Deserialization of the ROS messages used by camera recordings. Each function throws std::runtime_error, without file
// and topic, for invalid bytes.
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
#include "cairn/mapping/camera.hpp"
#include "io/ros/ros_recording.hpp"

namespace cairn {

struct RosHeader {
  double stamp = 0;      // seconds; 0: none
  std::string frame_id;  // without a leading slash
};
/// Reads the header at the front of many message types.
[[nodiscard]] RosHeader read_ros_header(std::span<const std::uint8_t> bytes, RosEncoding encoding);

/// Image, decompressed, in its recorded pixel format.
struct RosImage {
  enum class Kind { depth, color, gray, other };
  Kind kind = Kind::other;
  std::string encoding;             // as shown to users
  cv::Mat pixels;                   // may point into the message's bytes; rows hold complete pairs of pixels
  int width = 0;                    // of the image
  bool packed_from_meters = false;  // depth in meters, quantized to 16 bits with quant_a and quant_b
  float quant_a = 0, quant_b = 0;
  int to_rgba = -1;  // cv::ColorConversionCodes; -1: already RGBA
};
/// Reads an image; `type`: sensor_msgs/Image or sensor_msgs/CompressedImage. Throws std::runtime_error for an image
/// beyond `bound`, before decoding.
[[nodiscard]] RosImage read_ros_image(std::span<const std::uint8_t> bytes, RosEncoding encoding, std::string_view type,
                                      const ImageBound& bound = {});
/// Converts to depth in meters; 0: no measurement. `unit`: meters per unit of integer depth.
[[nodiscard]] std::vector<float> depth_of(const RosImage& image, double unit);
/// Converts to bytes R, G, B, 255.
[[nodiscard]] std::vector<std::uint32_t> color_of(const RosImage& image);

/// sensor_msgs/CameraInfo.
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
/// Returns the camera of raw or rectified images. Throws for a lens model not supported by Camera.
[[nodiscard]] Camera camera_of(const RosCameraInfo& info, bool rectified);

/// sensor_msgs/Imu.
struct RosImu {
  std::optional<Eigen::Vector3d> rate, acceleration;  // rad/s, m/s^2
};
[[nodiscard]] RosImu read_imu(std::span<const std::uint8_t> bytes, RosEncoding encoding);

struct RosTransform {
  std::string parent, child;  // frame names
  Eigen::Isometry3d parent_from_child = Eigen::Isometry3d::Identity();
};
/// Reads a tf2_msgs/TFMessage or tf/tfMessage.
[[nodiscard]] std::vector<RosTransform> read_tf(std::span<const std::uint8_t> bytes, RosEncoding encoding);
/// Reads a geometry_msgs/Transform.
[[nodiscard]] Eigen::Isometry3d read_transform(std::span<const std::uint8_t> bytes, RosEncoding encoding);
/// Reads a std_msgs/Float32.
[[nodiscard]] float read_float(std::span<const std::uint8_t> bytes, RosEncoding encoding);
/// Reads a diagnostic_msgs/KeyValue.
[[nodiscard]] std::pair<std::string, std::string> read_key_value(std::span<const std::uint8_t> bytes,
                                                                 RosEncoding encoding);

}  // namespace cairn
