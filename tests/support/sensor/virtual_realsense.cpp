// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stand-in for librealsense2 with a virtual D435I. CAIRN_REALSENSE: words of played_device.hpp, and
//   old    is version 2.10.0                        l515     is an L515
//   small  depth 480x270 in units of 0.2 mm, color 424x240, no lens, as at a USB 2 port
#include <array>
#include <atomic>
#include <memory>

#include "io/sensors/realsense_api.hpp"
#include "support/sensor/played_device.hpp"

using namespace cairn::realsense;
using virtual_sensor::ImageSize;

namespace {

virtual_sensor::PlayedDevices& played() {
  static virtual_sensor::PlayedDevices devices("CAIRN_REALSENSE");
  return devices;
}

constexpr const char* kSerials[] = {"123622270001", "123622270002"};
constexpr int kYuyv = 4, kMotionRate = 200;

}  // namespace

struct rs2_error {
  std::string message;
};
struct rs2_context {};
struct rs2_device {
  int index;
};
struct rs2_device_list {
  int count;
};
struct rs2_sensor {
  int index;  // 0: stereo module, 1: color, 2: motion
};
struct rs2_sensor_list {
  int count;
};
struct rs2_stream_profile {
  int stream, format, rate;
  ImageSize size;
};
struct rs2_stream_profile_list {
  std::vector<const rs2_stream_profile*> profiles;
};
struct rs2_config {
  std::string serial;
  std::vector<rs2_stream_profile> wanted;
};
struct rs2_pipeline_profile {
  rs2_pipeline* pipeline;
};
struct rs2_frame {
  const rs2_stream_profile* profile;
  double milliseconds;
  unsigned long long number;
  std::shared_ptr<const std::vector<char>> data;
  std::vector<rs2_frame> parts;  // of a composite frame
};
struct rs2_pipeline {
  std::vector<std::unique_ptr<rs2_stream_profile>> profiles;
  std::atomic<bool> running = false;
  std::thread thread;
  void stop() {
    running = false;
    if (thread.joinable()) thread.join();
  }
  ~rs2_pipeline() { stop(); }
  [[nodiscard]] const rs2_stream_profile* profile(int stream) const {
    for (const auto& p : profiles)
      if (p->stream == stream) return p.get();
    return nullptr;
  }
};

namespace {

void fail(rs2_error** error, const char* message) {
  if (error != nullptr) *error = new rs2_error{message};
}

/// Modes by sensor.
const std::vector<rs2_stream_profile>& modes_of(int sensor) {
  static const std::array<std::vector<rs2_stream_profile>, 3> kLarge{
      {{{kDepth, kZ16, 90, {848, 480}},
        {kDepth, kZ16, 30, {640, 480}},
        {kDepth, kZ16, 30, {848, 480}},
        {kDepth, kZ16, 15, {1280, 720}}},
       {{kColor, kYuyv, 30, {1280, 720}}, {kColor, kRgb8, 30, {640, 480}}, {kColor, kRgb8, 30, {1280, 720}}},
       {{kGyro, kMotion, 400, {}},
        {kGyro, kMotion, kMotionRate, {}},
        {kAccelerometer, kMotion, 63, {}},
        {kAccelerometer, kMotion, 250, {}}}}};
  static const std::array<std::vector<rs2_stream_profile>, 3> kSmall{
      {{{kDepth, kZ16, 30, {480, 270}}}, {{kColor, kRgb8, 30, {424, 240}}}, kLarge[2]}};
  return (played().has("small") ? kSmall : kLarge)[static_cast<std::size_t>(sensor)];
}

template <class T>
std::shared_ptr<const std::vector<char>> bytes_of(const T& values) {
  const auto* begin = reinterpret_cast<const char*>(values.data());
  return std::make_shared<const std::vector<char>>(begin, begin + sizeof(values[0]) * values.size());
}

/// Images of a pipeline's streams.
struct Content {
  std::vector<std::shared_ptr<const std::vector<char>>> depths, colors;
  Content(const rs2_stream_profile& depth, const rs2_stream_profile* color) {
    const virtual_sensor::PlayedImages images(played().word("frames"), depth.size,
                                              color != nullptr ? color->size : ImageSize{1, 1});
    for (const auto& image : images.depth) depths.push_back(bytes_of(image));
    for (const auto& image : images.color) colors.push_back(bytes_of(image));
  }
};

/// Delivers the images as sets, and the inertial samples before them one by one.
void play(const rs2_pipeline& pipeline, const Content& content, void (*on_frame)(rs2_frame*, void*), void* user) {
  const auto *depth = pipeline.profile(kDepth), *color = pipeline.profile(kColor), *gyro = pipeline.profile(kGyro),
             *accelerometer = pipeline.profile(kAccelerometer);
  while (pipeline.running) {
    const auto exposure = played().next();
    if (!exposure || !pipeline.running) return;
    const double ms = 1000 * exposure->seconds;
    const auto number = static_cast<unsigned long long>(exposure->number);
    for (int i = 6; i > 0; --i) {
      const double sample = ms - 5.0 * i;
      if (gyro != nullptr)
        on_frame(new rs2_frame{gyro, sample, number, bytes_of(std::array{0.1f, 0.2f, 0.3f}), {}}, user);
      if (accelerometer != nullptr)
        on_frame(new rs2_frame{accelerometer, sample, number, bytes_of(std::array{0.0f, -9.81f, 0.0f}), {}}, user);
    }
    const auto image = static_cast<std::size_t>(exposure->image) % content.depths.size();
    auto set = std::make_unique<rs2_frame>(rs2_frame{depth, ms, number, nullptr, {}});
    set->parts.push_back({depth, ms, number, content.depths[image], {}});
    if (color != nullptr) set->parts.push_back({color, ms + 4, number, content.colors[image], {}});
    on_frame(set.release(), user);
  }
}

}  // namespace

extern "C" {

int rs2_get_api_version(rs2_error**) { return played().has("old") ? 21000 : 25001; }
const char* rs2_get_error_message(const rs2_error* error) { return error->message.c_str(); }
void rs2_free_error(rs2_error* error) { delete error; }

rs2_context* rs2_create_context(int version, rs2_error** error) {
  if (version > rs2_get_api_version(nullptr)) fail(error, "API version mismatch");
  return new rs2_context;
}
void rs2_delete_context(rs2_context* context) { delete context; }
rs2_device_list* rs2_query_devices(const rs2_context*, rs2_error**) {
  return new rs2_device_list{played().connected()};
}
int rs2_get_device_count(const rs2_device_list* list, rs2_error**) { return list->count; }
rs2_device* rs2_create_device(const rs2_device_list*, int index, rs2_error**) { return new rs2_device{index}; }
void rs2_delete_device_list(rs2_device_list* list) { delete list; }
int rs2_supports_device_info(const rs2_device*, int info, rs2_error**) {
  return info == kName || info == kSerialNumber || info == kProductLine;
}
const char* rs2_get_device_info(const rs2_device* device, int info, rs2_error**) {
  const bool l515 = played().has("l515");
  if (info == kSerialNumber) return kSerials[device->index];
  if (info == kProductLine) return l515 ? "L500" : "D400";
  return l515 ? "Intel RealSense L515" : "Intel RealSense D435I";
}
void rs2_delete_device(rs2_device* device) { delete device; }

rs2_sensor_list* rs2_query_sensors(const rs2_device*, rs2_error**) {
  return new rs2_sensor_list{played().has("noimu") ? 2 : 3};
}
int rs2_get_sensors_count(const rs2_sensor_list* list, rs2_error**) { return list->count; }
rs2_sensor* rs2_create_sensor(const rs2_sensor_list*, int index, rs2_error**) { return new rs2_sensor{index}; }
void rs2_delete_sensor_list(rs2_sensor_list* list) { delete list; }
int rs2_is_sensor_extendable_to(const rs2_sensor* sensor, int extension, rs2_error**) {
  return extension == kDepthSensor && sensor->index == 0;
}
float rs2_get_depth_scale(rs2_sensor* sensor, rs2_error** error) {
  if (sensor->index != 0) fail(error, "Object does not support \"depth_sensor\" interface!");
  return played().has("small") ? 0.0002f : played().has("l515") ? 0.00025f : 0.001f;
}
rs2_stream_profile_list* rs2_get_stream_profiles(rs2_sensor* sensor, rs2_error**) {
  auto list = std::make_unique<rs2_stream_profile_list>();
  for (const auto& mode : modes_of(sensor->index)) list->profiles.push_back(&mode);
  return list.release();
}
void rs2_delete_sensor(rs2_sensor* sensor) { delete sensor; }

int rs2_get_stream_profiles_count(const rs2_stream_profile_list* list, rs2_error**) {
  return static_cast<int>(list->profiles.size());
}
const rs2_stream_profile* rs2_get_stream_profile(const rs2_stream_profile_list* list, int index, rs2_error**) {
  return list->profiles.at(static_cast<std::size_t>(index));
}
void rs2_delete_stream_profiles_list(rs2_stream_profile_list* list) { delete list; }
void rs2_get_stream_profile_data(const rs2_stream_profile* profile, int* stream, int* format, int* index,
                                 int* unique_id, int* framerate, rs2_error**) {
  *stream = profile->stream, *format = profile->format, *framerate = profile->rate;
  *index = *unique_id = 0;
}
void rs2_get_video_stream_resolution(const rs2_stream_profile* profile, int* width, int* height, rs2_error**) {
  *width = profile->size.width, *height = profile->size.height;
}
void rs2_get_video_stream_intrinsics(const rs2_stream_profile* profile, rs2_intrinsics* intrinsics, rs2_error**) {
  const auto w = static_cast<float>(profile->size.width), h = static_cast<float>(profile->size.height);
  const float f = (profile->stream == kDepth ? 0.5f : 0.75f) * w;
  *intrinsics = {profile->size.width, profile->size.height, w / 2 - 0.5f, h / 2 - 0.5f, f, f, kBrown, {}};
  if (profile->stream != kColor || played().has("small")) return;
  intrinsics->model = kInverseBrown;
  std::memcpy(intrinsics->coeffs, std::array{-0.05f, 0.06f, 0.0005f, -0.0005f, -0.02f}.data(), 5 * sizeof(float));
}
/// Color: 15 mm to the right of depth. The inertial sensor is a quarter turn about z from depth.
void rs2_get_extrinsics(const rs2_stream_profile* from, const rs2_stream_profile* to, rs2_extrinsics* extrinsics,
                        rs2_error** error) {
  *extrinsics = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {}};
  if (from->stream == kDepth && to->stream == kColor)
    extrinsics->translation[0] = -0.015f;
  else if ((from->stream == kGyro || from->stream == kAccelerometer) && to->stream == kDepth)
    *extrinsics = {{0, 1, 0, -1, 0, 0, 0, 0, 1}, {}};
  else
    fail(error, "no extrinsics");
}

rs2_config* rs2_create_config(rs2_error**) { return new rs2_config; }
void rs2_config_enable_device(rs2_config* config, const char* serial, rs2_error**) { config->serial = serial; }
void rs2_config_enable_stream(rs2_config* config, int stream, int, int width, int height, int format, int framerate,
                              rs2_error**) {
  config->wanted.push_back({stream, format, framerate, {width, height}});
}
void rs2_delete_config(rs2_config* config) { delete config; }
rs2_pipeline* rs2_create_pipeline(rs2_context*, rs2_error**) { return new rs2_pipeline; }
rs2_pipeline_profile* rs2_pipeline_start_with_config_and_callback(rs2_pipeline* pipeline, rs2_config* config,
                                                                  void (*on_frame)(rs2_frame*, void*), void* user,
                                                                  rs2_error** error) {
  const int connected = played().connected();
  const bool is_known =
      (connected > 0 && config->serial == kSerials[0]) || (connected > 1 && config->serial == kSerials[1]);
  if (!is_known || played().has("busy")) {
    fail(error, is_known ? "failed to open usb interface: 0, error: RS2_USB_STATUS_BUSY" : "No device connected");
    return nullptr;
  }
  for (const auto& wanted : config->wanted) pipeline->profiles.push_back(std::make_unique<rs2_stream_profile>(wanted));
  const Content content(*pipeline->profile(kDepth), pipeline->profile(kColor));
  played().start();
  pipeline->running = true;
  pipeline->thread = std::thread([=] { play(*pipeline, content, on_frame, user); });
  return new rs2_pipeline_profile{pipeline};
}
void rs2_pipeline_stop(rs2_pipeline* pipeline, rs2_error**) { pipeline->stop(); }
void rs2_delete_pipeline(rs2_pipeline* pipeline) { delete pipeline; }
rs2_stream_profile_list* rs2_pipeline_profile_get_streams(rs2_pipeline_profile* profile, rs2_error**) {
  auto list = std::make_unique<rs2_stream_profile_list>();
  for (const auto& p : profile->pipeline->profiles) list->profiles.push_back(p.get());
  return list.release();
}
void rs2_delete_pipeline_profile(rs2_pipeline_profile* profile) { delete profile; }

int rs2_is_frame_extendable_to(const rs2_frame* frame, int extension, rs2_error**) {
  return extension == kCompositeFrame && !frame->parts.empty();
}
int rs2_embedded_frames_count(rs2_frame* frame, rs2_error**) { return static_cast<int>(frame->parts.size()); }
rs2_frame* rs2_extract_frame(rs2_frame* frame, int index, rs2_error**) {
  return new rs2_frame(frame->parts.at(static_cast<std::size_t>(index)));
}
const rs2_stream_profile* rs2_get_frame_stream_profile(const rs2_frame* frame, rs2_error**) { return frame->profile; }
double rs2_get_frame_timestamp(const rs2_frame* frame, rs2_error**) { return frame->milliseconds; }
int rs2_get_frame_timestamp_domain(const rs2_frame*, rs2_error**) { return 0; }
unsigned long long rs2_get_frame_number(const rs2_frame* frame, rs2_error**) { return frame->number; }
const void* rs2_get_frame_data(const rs2_frame* frame, rs2_error**) { return frame->data->data(); }
int rs2_get_frame_width(const rs2_frame* frame, rs2_error**) { return frame->profile->size.width; }
int rs2_get_frame_height(const rs2_frame* frame, rs2_error**) { return frame->profile->size.height; }
int rs2_get_frame_stride_in_bytes(const rs2_frame* frame, rs2_error**) {
  return frame->profile->size.width * (frame->profile->stream == kDepth ? 2 : 3);
}
void rs2_release_frame(rs2_frame* frame) { delete frame; }

}  // extern "C"
