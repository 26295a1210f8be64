// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// C interface of libk4a, version 1.2 and later, as far as it is used:
// https://github.com/microsoft/Azure-Kinect-Sensor-SDK, and with the same interface
// https://github.com/orbbec/OrbbecSDK-K4A-Wrapper. Enumerations are passed as int.
#pragma once
#include <cstddef>
#include <cstdint>

extern "C" {

struct _k4a_device_t;
struct _k4a_capture_t;
struct _k4a_image_t;
using k4a_device_t = _k4a_device_t*;
using k4a_capture_t = _k4a_capture_t*;
using k4a_image_t = _k4a_image_t*;

struct k4a_device_configuration_t {
  int color_format, color_resolution, depth_mode, camera_fps;
  bool synchronized_images_only;  // false: captures may lack the color or the depth image
  std::int32_t depth_delay_off_color_usec;
  int wired_sync_mode;
  std::uint32_t subordinate_delay_off_master_usec;
  bool disable_streaming_indicator;
};
/// Maps points from one sensor's frame to another's.
struct k4a_calibration_extrinsics_t {
  float rotation[9];     // row by row
  float translation[3];  // millimeters
};
struct k4a_calibration_intrinsics_t {
  int type;  // lens model
  unsigned int parameter_count;
  float parameters[15];  // cx cy fx fy, in pixels; k1 to k6, center of distortion, p2 p1, radius
};
struct k4a_calibration_camera_t {
  k4a_calibration_extrinsics_t extrinsics;
  k4a_calibration_intrinsics_t intrinsics;
  int resolution_width, resolution_height;
  float metric_radius;
};
struct k4a_calibration_t {
  k4a_calibration_camera_t depth_camera_calibration, color_camera_calibration;
  k4a_calibration_extrinsics_t extrinsics[4][4];  // from, to; see Sensor
  int depth_mode, color_resolution;
};
struct k4a_imu_sample_t {
  float temperature;
  float acc_sample[3];  // m/s^2
  std::uint64_t acc_timestamp_usec;
  float gyro_sample[3];  // rad/s
  std::uint64_t gyro_timestamp_usec;
};

std::uint32_t k4a_device_get_installed_count();
int k4a_device_open(std::uint32_t index, k4a_device_t* device);
void k4a_device_close(k4a_device_t device);
/// `size`: of `serial` with its final 0; set to the required size.
int k4a_device_get_serialnum(k4a_device_t device, char* serial, std::size_t* size);
int k4a_device_get_calibration(k4a_device_t device, int depth_mode, int color_resolution,
                               k4a_calibration_t* calibration);
int k4a_device_start_cameras(k4a_device_t device, const k4a_device_configuration_t* configuration);
void k4a_device_stop_cameras(k4a_device_t device);
int k4a_device_start_imu(k4a_device_t device);  // after the cameras, which reset its clock
void k4a_device_stop_imu(k4a_device_t device);
int k4a_device_get_capture(k4a_device_t device, k4a_capture_t* capture, std::int32_t timeout_ms);
int k4a_device_get_imu_sample(k4a_device_t device, k4a_imu_sample_t* sample, std::int32_t timeout_ms);

/// Null if the capture lacks the image.
k4a_image_t k4a_capture_get_depth_image(k4a_capture_t capture);
k4a_image_t k4a_capture_get_color_image(k4a_capture_t capture);
void k4a_capture_release(k4a_capture_t capture);
std::uint8_t* k4a_image_get_buffer(k4a_image_t image);
std::size_t k4a_image_get_size(k4a_image_t image);  // bytes
int k4a_image_get_width_pixels(k4a_image_t image);
int k4a_image_get_height_pixels(k4a_image_t image);
int k4a_image_get_stride_bytes(k4a_image_t image);
std::uint64_t k4a_image_get_device_timestamp_usec(k4a_image_t image);  // middle of the exposure
void k4a_image_release(k4a_image_t image);

}  // extern "C"

namespace cairn::k4a {

// Values of libk4a's enumerations.
enum Result { kSucceeded = 0, kTimeout = 2 };                              // k4a_result_t and k4a_wait_result_t
enum BufferResult { kTooSmall = 2 };                                       // k4a_buffer_result_t
enum Sensor { kDepth, kColor, kGyro, kAccelerometer };                     // k4a_calibration_type_t
enum LensModel { kRational6Kt = 3, kBrownConrady = 4 };                    // k4a_calibration_model_type_t
enum Mode { kBgra32 = 3, kColor720p = 1, kNarrow640x576 = 2, k30Hz = 2 };  // format, resolution, depth mode, rate

// clang-format off
#define CAIRN_K4A(X) \
  X(k4a_device_get_installed_count) X(k4a_device_open) X(k4a_device_close) X(k4a_device_get_serialnum) \
  X(k4a_device_get_calibration) X(k4a_device_start_cameras) X(k4a_device_stop_cameras) X(k4a_device_start_imu) \
  X(k4a_device_stop_imu) X(k4a_device_get_capture) X(k4a_device_get_imu_sample) X(k4a_capture_get_depth_image) \
  X(k4a_capture_get_color_image) X(k4a_capture_release) X(k4a_image_get_buffer) X(k4a_image_get_size) \
  X(k4a_image_get_width_pixels) X(k4a_image_get_height_pixels) X(k4a_image_get_stride_bytes) \
  X(k4a_image_get_device_timestamp_usec) X(k4a_image_release)
// clang-format on

}  // namespace cairn::k4a
