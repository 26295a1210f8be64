// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stand-in for libk4a with a virtual Azure Kinect. CAIRN_K4A: words of played_device.hpp, and
//   nocalibration  cannot read its calibration
// Compiled with CAIRN_OLD_K4A it lacks a function, as version 1.1.
#include <cmath>
#include <memory>

#include "io/sensors/k4a_api.hpp"
#include "support/sensor/played_device.hpp"

using namespace cairn::k4a;
using virtual_sensor::ImageSize;

namespace {

virtual_sensor::PlayedDevices& played() {
  static virtual_sensor::PlayedDevices devices("CAIRN_K4A");
  return devices;
}

constexpr const char* kSerials[] = {"000145594512", "000145594513"};
constexpr ImageSize kDepthSize{640, 576}, kColorSize{1280, 720};
constexpr int kFailed = 1, kSamples = 50;  // inertial samples an image

std::uint64_t microseconds(double seconds) { return static_cast<std::uint64_t>(std::llround(1e6 * seconds)); }

}  // namespace

struct _k4a_device_t {
  std::uint32_t index;
  std::unique_ptr<virtual_sensor::PlayedImages> images;
  double time = 0;
  int samples_left = 0;
};
struct _k4a_image_t {
  ImageSize size;
  int stride;
  double time;
  std::vector<std::uint8_t> bytes;
};
struct _k4a_capture_t {
  _k4a_image_t depth, color;
};

extern "C" {

std::uint32_t k4a_device_get_installed_count() { return static_cast<std::uint32_t>(played().connected()); }
int k4a_device_open(std::uint32_t index, k4a_device_t* device) {
  if (index >= k4a_device_get_installed_count() || played().has("busy")) return kFailed;
  *device = new _k4a_device_t{index, nullptr};
  return kSucceeded;
}
void k4a_device_close(k4a_device_t device) { delete device; }
int k4a_device_get_serialnum(k4a_device_t device, char* serial, std::size_t* size) {
  const std::string number = kSerials[device->index];
  const bool fits = serial != nullptr && *size > number.size();
  *size = number.size() + 1;
  if (!fits) return kTooSmall;
  std::memcpy(serial, number.c_str(), *size);
  return kSucceeded;
}
/// Color: 32 mm to the right of depth. The inertial sensor is a quarter turn about z from depth.
int k4a_device_get_calibration(k4a_device_t, int depth_mode, int color_resolution, k4a_calibration_t* calibration) {
  if (played().has("nocalibration") || depth_mode != kNarrow640x576 || color_resolution != kColor720p) return kFailed;
  *calibration = {};
  constexpr k4a_calibration_extrinsics_t kNone{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {}};
  for (auto& row : calibration->extrinsics)
    for (auto& extrinsics : row) extrinsics = kNone;
  calibration->extrinsics[kDepth][kColor].translation[0] = -32;
  for (const int sensor : {kGyro, kAccelerometer})
    calibration->extrinsics[sensor][kDepth] = {{0, -1, 0, 1, 0, 0, 0, 0, 1}, {}};
  calibration->depth_camera_calibration = {
      kNone,
      {kBrownConrady, 14, {320.5f, 288.25f, 504, 505, 0.5f, -0.02f, -0.002f, 0.9f, 0.08f, -0.01f, 0, 0, -7e-5f, 2e-5f}},
      kDepthSize.width,
      kDepthSize.height,
      1.74f};
  calibration->color_camera_calibration = {
      kNone,
      {kBrownConrady, 14, {639.25f, 365.5f, 611, 612, 0.33f, -2.5f, 1.4f, 0.2f, -2.3f, 1.37f, 0, 0, -1e-4f, -1.5e-4f}},
      kColorSize.width,
      kColorSize.height,
      1.7f};
  return kSucceeded;
}
int k4a_device_start_cameras(k4a_device_t device, const k4a_device_configuration_t* configuration) {
  if (configuration->color_format != kBgra32 || configuration->camera_fps != k30Hz) return kFailed;
  device->images = std::make_unique<virtual_sensor::PlayedImages>(played().word("frames"), kDepthSize, kColorSize);
  played().start();
  return kSucceeded;
}
void k4a_device_stop_cameras(k4a_device_t) {}
int k4a_device_start_imu(k4a_device_t) { return played().has("noimu") ? kFailed : kSucceeded; }
void k4a_device_stop_imu(k4a_device_t) {}
int k4a_device_get_capture(k4a_device_t device, k4a_capture_t* capture, std::int32_t) {
  const auto exposure = played().next();
  if (!exposure) return kFailed;
  device->time = exposure->seconds;
  device->samples_left = kSamples;
  const auto image = static_cast<std::size_t>(exposure->image) % device->images->depth.size();
  const auto& depth = device->images->depth[image];
  const auto& color = device->images->color[image];
  auto taken = std::make_unique<_k4a_capture_t>(
      _k4a_capture_t{{kDepthSize, 2 * kDepthSize.width, device->time, {depth.begin(), depth.end()}},
                     {kColorSize, 4 * kColorSize.width, device->time + 0.004, {}}});
  for (std::size_t p = 0; p + 2 < color.size(); p += 3)
    for (const int channel : {2, 1, 0, -1})
      taken->color.bytes.push_back(
          channel < 0 ? 0 : static_cast<std::uint8_t>(color[p + static_cast<std::size_t>(channel)]));
  *capture = taken.release();
  return kSucceeded;
}
int k4a_device_get_imu_sample(k4a_device_t device, k4a_imu_sample_t* sample, std::int32_t) {
  if (device->samples_left == 0) return kTimeout;
  const std::uint64_t time = microseconds(device->time - device->samples_left-- * virtual_sensor::kPeriod / kSamples);
  *sample = {30, {0, -9.81f, 0}, time, {0.1f, 0.2f, 0.3f}, time};
  return kSucceeded;
}

k4a_image_t k4a_capture_get_depth_image(k4a_capture_t capture) { return new _k4a_image_t(capture->depth); }
k4a_image_t k4a_capture_get_color_image(k4a_capture_t capture) { return new _k4a_image_t(capture->color); }
void k4a_capture_release(k4a_capture_t capture) { delete capture; }
std::uint8_t* k4a_image_get_buffer(k4a_image_t image) { return image->bytes.data(); }
std::size_t k4a_image_get_size(k4a_image_t image) { return image->bytes.size(); }
int k4a_image_get_width_pixels(k4a_image_t image) { return image->size.width; }
int k4a_image_get_height_pixels(k4a_image_t image) { return image->size.height; }
int k4a_image_get_stride_bytes(k4a_image_t image) { return image->stride; }
#ifndef CAIRN_OLD_K4A
std::uint64_t k4a_image_get_device_timestamp_usec(k4a_image_t image) { return microseconds(image->time); }
#endif
void k4a_image_release(k4a_image_t image) { delete image; }

}  // extern "C"
