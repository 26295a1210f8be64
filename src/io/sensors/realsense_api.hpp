// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// C interface of librealsense2, version 2.24 and later, as far as it is used:
// https://github.com/IntelRealSense/librealsense. Enumerations are passed as int.
#pragma once

extern "C" {

struct rs2_config;
struct rs2_context;
struct rs2_device;
struct rs2_device_list;
struct rs2_error;
struct rs2_frame;
struct rs2_pipeline;
struct rs2_pipeline_profile;
struct rs2_sensor;
struct rs2_sensor_list;
struct rs2_stream_profile;
struct rs2_stream_profile_list;

struct rs2_intrinsics {
  int width, height;
  float ppx, ppy, fx, fy;  // pixels; pixel (0, 0) is the center of the first pixel
  int model;               // RS2_DISTORTION
  float coeffs[5];
};
/// Maps points from one stream's frame to another's.
struct rs2_extrinsics {
  float rotation[9];     // column by column
  float translation[3];  // meters
};

/// Each function but those that delete sets its last argument to an error, to be freed by the caller.
int rs2_get_api_version(rs2_error** error);  // 10000 major + 100 minor + patch
const char* rs2_get_error_message(const rs2_error* error);
void rs2_free_error(rs2_error* error);

rs2_context* rs2_create_context(int api_version, rs2_error** error);
void rs2_delete_context(rs2_context* context);
rs2_device_list* rs2_query_devices(const rs2_context* context, rs2_error** error);
int rs2_get_device_count(const rs2_device_list* list, rs2_error** error);
rs2_device* rs2_create_device(const rs2_device_list* list, int index, rs2_error** error);
void rs2_delete_device_list(rs2_device_list* list);
int rs2_supports_device_info(const rs2_device* device, int info, rs2_error** error);
const char* rs2_get_device_info(const rs2_device* device, int info, rs2_error** error);
void rs2_delete_device(rs2_device* device);

rs2_sensor_list* rs2_query_sensors(const rs2_device* device, rs2_error** error);
int rs2_get_sensors_count(const rs2_sensor_list* list, rs2_error** error);
rs2_sensor* rs2_create_sensor(const rs2_sensor_list* list, int index, rs2_error** error);
void rs2_delete_sensor_list(rs2_sensor_list* list);
int rs2_is_sensor_extendable_to(const rs2_sensor* sensor, int extension, rs2_error** error);
float rs2_get_depth_scale(rs2_sensor* sensor, rs2_error** error);  // meters per unit
rs2_stream_profile_list* rs2_get_stream_profiles(rs2_sensor* sensor, rs2_error** error);
void rs2_delete_sensor(rs2_sensor* sensor);

int rs2_get_stream_profiles_count(const rs2_stream_profile_list* list, rs2_error** error);
const rs2_stream_profile* rs2_get_stream_profile(const rs2_stream_profile_list* list, int index, rs2_error** error);
void rs2_delete_stream_profiles_list(rs2_stream_profile_list* list);
void rs2_get_stream_profile_data(const rs2_stream_profile* profile, int* stream, int* format, int* index,
                                 int* unique_id, int* framerate, rs2_error** error);
void rs2_get_video_stream_resolution(const rs2_stream_profile* profile, int* width, int* height, rs2_error** error);
void rs2_get_video_stream_intrinsics(const rs2_stream_profile* profile, rs2_intrinsics* intrinsics, rs2_error** error);
void rs2_get_extrinsics(const rs2_stream_profile* from, const rs2_stream_profile* to, rs2_extrinsics* extrinsics,
                        rs2_error** error);

rs2_config* rs2_create_config(rs2_error** error);
void rs2_config_enable_device(rs2_config* config, const char* serial, rs2_error** error);
void rs2_config_enable_stream(rs2_config* config, int stream, int index, int width, int height, int format,
                              int framerate, rs2_error** error);
void rs2_delete_config(rs2_config* config);
rs2_pipeline* rs2_create_pipeline(rs2_context* context, rs2_error** error);
/// Calls `on_frame` from the library's threads with frames to be released: sets of images, and single samples.
rs2_pipeline_profile* rs2_pipeline_start_with_config_and_callback(rs2_pipeline* pipeline, rs2_config* config,
                                                                  void (*on_frame)(rs2_frame*, void*), void* user,
                                                                  rs2_error** error);
void rs2_pipeline_stop(rs2_pipeline* pipeline, rs2_error** error);
void rs2_delete_pipeline(rs2_pipeline* pipeline);
rs2_stream_profile_list* rs2_pipeline_profile_get_streams(rs2_pipeline_profile* profile, rs2_error** error);
void rs2_delete_pipeline_profile(rs2_pipeline_profile* profile);

int rs2_is_frame_extendable_to(const rs2_frame* frame, int extension, rs2_error** error);
int rs2_embedded_frames_count(rs2_frame* frame, rs2_error** error);
rs2_frame* rs2_extract_frame(rs2_frame* frame, int index, rs2_error** error);  // a new reference
const rs2_stream_profile* rs2_get_frame_stream_profile(const rs2_frame* frame, rs2_error** error);
double rs2_get_frame_timestamp(const rs2_frame* frame, rs2_error** error);  // milliseconds
int rs2_get_frame_timestamp_domain(const rs2_frame* frame, rs2_error** error);
unsigned long long rs2_get_frame_number(const rs2_frame* frame, rs2_error** error);
const void* rs2_get_frame_data(const rs2_frame* frame, rs2_error** error);
int rs2_get_frame_width(const rs2_frame* frame, rs2_error** error);
int rs2_get_frame_height(const rs2_frame* frame, rs2_error** error);
int rs2_get_frame_stride_in_bytes(const rs2_frame* frame, rs2_error** error);
void rs2_release_frame(rs2_frame* frame);

}  // extern "C"

namespace cairn::realsense {

// Values of librealsense2's enumerations.
enum Stream { kDepth = 1, kColor = 2, kGyro = 5, kAccelerometer = 6 };                      // RS2_STREAM
enum Format { kZ16 = 1, kRgb8 = 5, kMotion = 16 };                                          // RS2_FORMAT
enum Info { kName = 0, kSerialNumber = 1, kProductLine = 10 };                              // RS2_CAMERA_INFO
enum Extension { kDepthSensor = 7, kCompositeFrame = 10 };                                  // RS2_EXTENSION
enum Distortion { kNone, kModifiedBrown, kInverseBrown, kFTheta, kBrown, kKannalaBrandt };  // RS2_DISTORTION

// clang-format off
#define CAIRN_REALSENSE(X) \
  X(rs2_get_api_version) X(rs2_get_error_message) X(rs2_free_error) X(rs2_create_context) X(rs2_delete_context) \
  X(rs2_query_devices) X(rs2_get_device_count) X(rs2_create_device) X(rs2_delete_device_list) \
  X(rs2_supports_device_info) X(rs2_get_device_info) X(rs2_delete_device) X(rs2_query_sensors) \
  X(rs2_get_sensors_count) X(rs2_create_sensor) X(rs2_delete_sensor_list) X(rs2_is_sensor_extendable_to) \
  X(rs2_get_depth_scale) X(rs2_get_stream_profiles) X(rs2_delete_sensor) X(rs2_get_stream_profiles_count) \
  X(rs2_get_stream_profile) X(rs2_delete_stream_profiles_list) X(rs2_get_stream_profile_data) \
  X(rs2_get_video_stream_resolution) X(rs2_get_video_stream_intrinsics) X(rs2_get_extrinsics) X(rs2_create_config) \
  X(rs2_config_enable_device) X(rs2_config_enable_stream) X(rs2_delete_config) X(rs2_create_pipeline) \
  X(rs2_pipeline_start_with_config_and_callback) X(rs2_pipeline_stop) X(rs2_delete_pipeline) \
  X(rs2_pipeline_profile_get_streams) X(rs2_delete_pipeline_profile) X(rs2_is_frame_extendable_to) \
  X(rs2_embedded_frames_count) X(rs2_extract_frame) X(rs2_get_frame_stream_profile) X(rs2_get_frame_timestamp) \
  X(rs2_get_frame_timestamp_domain) X(rs2_get_frame_number) X(rs2_get_frame_data) X(rs2_get_frame_width) \
  X(rs2_get_frame_height) X(rs2_get_frame_stride_in_bytes) X(rs2_release_frame)
// clang-format on

}  // namespace cairn::realsense
