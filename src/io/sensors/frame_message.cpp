// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/sensors/frame_message.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "base/depth_image.hpp"
#include "base/image_file.hpp"
#include "base/json_text.hpp"
#include "base/little_endian.hpp"
#include "base/read_json.hpp"
#include "base/words.hpp"
#include "io/camera_file.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;
using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t kPrefix = 4;           // bytes of the header's size
constexpr std::size_t kMaxValues = 100'000;  // JSON values of a header: 5,000 samples of each inertial sensor
constexpr std::size_t kMaxName = 100;        // characters
constexpr double kMaxTime = 1e12;            // seconds
constexpr double kMaxMotion = 1e4;           // rad/s, m/s^2
constexpr double kMaxTranslation = 1e6;      // meters
constexpr double kMaxDelay = 1;              // seconds between depth and color
constexpr double kUnitTolerance = 1e-2;      // of a quaternion's length

/// Header and the bytes behind it.
struct Parts {
  Json header;
  Bytes data;
};

Parts parts_of(Bytes message) {
  if (message.size() < kPrefix)
    throw std::runtime_error(
        fmt::format("the message has {} bytes: it begins with its header's size, a little-endian "
                    "uint32",
                    message.size()));
  const std::uint32_t size = little_endian_uint32(message.first<kPrefix>());
  if (size > std::min(kMaxFrameHeader, message.size() - kPrefix))
    throw std::runtime_error(
        fmt::format("the header's size is {} bytes, allowed: {} and the message's {}: send it as little-endian uint32",
                    size, kMaxFrameHeader, message.size() - kPrefix));
  const Bytes text = message.subspan(kPrefix, size);
  try {
    check_json_values({reinterpret_cast<const char*>(text.data()), text.size()}, kMaxValues);
    Json header = parsed_json(text);
    if (!header.is_object()) throw std::runtime_error("the header is not a JSON object");
    return {std::move(header), message.subspan(kPrefix + size)};
  } catch (const Json::exception&) {
    throw std::runtime_error("the header is not JSON: send UTF-8, without NaN and Infinity");
  }
}

void check_keys(const Json& object, const char* name, std::initializer_list<std::string_view> keys) {
  for (const auto& item : object.items())
    if (std::find(keys.begin(), keys.end(), item.key()) == keys.end())
      throw std::runtime_error(
          fmt::format("'{}' is not a key of the {}: use {}", shown(item.key()), name, fmt::join(keys, ", ")));
}

const Json* find(const Json& object, const char* key) {
  const auto it = object.find(key);
  return it == object.end() || it->is_null() ? nullptr : &*it;
}

/// Finite number of at most `max` in size.
double number(const Json& value, const char* name, double max) {
  if (!value.is_number()) throw std::runtime_error(fmt::format("`{}` is not a number", name));
  const auto v = value.get<double>();
  if (!(std::abs(v) <= max))
    throw std::runtime_error(fmt::format("`{}` has {}, allowed: -{} to {}", name, v, max, max));
  return v;
}

template <std::size_t count>
std::array<double, count> numbers(const Json& value, const char* name, const std::array<double, count>& max,
                                  const char* expected) {
  if (!value.is_array() || value.size() != count)
    throw std::runtime_error(fmt::format("`{}` takes {}", name, expected));
  std::array<double, count> read{};
  for (std::size_t i = 0; i < count; ++i) read[i] = number(value[i], name, max[i]);
  return read;
}

std::string text_at(const Json& object, const char* key) {
  const Json* value = find(object, key);
  if (value == nullptr) return {};
  if (!value->is_string() || value->get_ref<const std::string&>().size() > kMaxName)
    throw std::runtime_error(fmt::format("`{}` is not a text of at most {} characters", key, kMaxName));
  return value->get<std::string>();
}

std::optional<PoseConvention> poses_of(const Json& hello) {
  const Json* poses = find(hello, "poses");
  if (poses == nullptr || *poses == Json(false)) return std::nullopt;
  if (*poses == Json(true)) return PoseConvention{};
  PoseConvention convention = pose_convention(text_at(hello, "poses"));
  if (convention.clock != 0) throw std::runtime_error("`poses` has a clock: send `time` and poses of the same clock");
  return convention;
}

void read_camera(const Json& hello, HelloMessage& read) {
  const Json* camera = find(hello, "camera");
  if (camera == nullptr || !camera->is_object())
    throw std::runtime_error("`camera` is missing: send an object with width, height, fx, fy, cx and cy");
  for (const char* side : {"width", "height"})
    if (!camera->contains(side)) throw std::runtime_error(fmt::format("camera: `{}` is missing", side));
  try {
    const CameraFile file = camera_of_text(text_of(*camera));
    check(file.rig);
    read.rig = file.rig;
    read.depth_scale = file.depth_scale.value_or(kDefaultDepthScale);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("camera: {}", error.what()));
  }
}

std::size_t pixels(const Camera& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

/// Encoded image of a frame.
struct Part {
  std::string format;  // empty: absent
  Bytes bytes;
};

/// Takes the part from the begin of `data`.
Part take_part(const Json& header, const char* name, std::initializer_list<std::string_view> formats, Bytes& data) {
  const Json* part = find(header, name);
  if (part == nullptr) return {};
  if (!part->is_object()) throw std::runtime_error(fmt::format("`{}` takes {{\"format\": ..., \"bytes\": ...}}", name));
  check_keys(*part, name, {"format", "bytes", "delay"});
  const std::string format = text_at(*part, "format");
  if (std::find(formats.begin(), formats.end(), format) == formats.end())
    throw std::runtime_error(
        fmt::format("{}: format '{}' is unknown: use {}", name, shown(format), fmt::join(formats, ", ")));
  const Json* bytes = find(*part, "bytes");
  if (bytes == nullptr || !bytes->is_number_unsigned())
    throw std::runtime_error(fmt::format("{}: `bytes` is not a size", name));
  const auto size = bytes->get<std::uint64_t>();
  if (size == 0 || size > data.size())
    throw std::runtime_error(
        fmt::format("{}: `bytes` is {}, allowed: 1 to the {} left in the message", name, size, data.size()));
  Part taken{format, data.first(static_cast<std::size_t>(size))};
  data = data.subspan(static_cast<std::size_t>(size));
  return taken;
}

void check_raw_size(const Part& part, const char* name, const Camera& camera, std::size_t bytes_per_pixel) {
  const std::size_t expected = pixels(camera) * bytes_per_pixel;
  if (part.bytes.size() != expected)
    throw std::runtime_error(fmt::format("{}: {} bytes of {}, the camera of {}x{} needs {}", name, part.bytes.size(),
                                         part.format, camera.width, camera.height, expected));
}

/// Decodes a PNG or JPEG of the camera's size.
cv::Mat decoded(const Part& part, const char* name, const Camera& camera, Pixels as) {
  constexpr std::string_view kPng = "\x89PNG";
  const bool is_png = part.bytes.size() > kPng.size() && std::memcmp(part.bytes.data(), kPng.data(), kPng.size()) == 0;
  const bool is_jpeg = part.bytes.size() > 2 && part.bytes[0] == 0xff && part.bytes[1] == 0xd8;
  if (part.format == "png" ? !is_png : !is_jpeg)
    throw std::runtime_error(fmt::format("{}: its bytes are not {}", name, part.format));
  try {
    return decode_image(part.bytes, as, {.size = {camera.width, camera.height}});
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", name, error.what()));
  }
}

std::vector<float> float_depth(Bytes bytes, const Camera& camera) {
  std::vector<float> depth(pixels(camera));
  std::memcpy(depth.data(), bytes.data(), bytes.size());
  const auto wrong = std::find_if(depth.begin(), depth.end(), [](float z) { return !(std::isfinite(z) && z >= 0); });
  if (wrong != depth.end()) {
    const auto at = static_cast<int>(wrong - depth.begin());
    throw std::runtime_error(fmt::format("depth: {} at pixel {}, {}: send meters, and 0 without a measurement", *wrong,
                                         at % camera.width, at / camera.width));
  }
  return depth;
}

std::vector<float> depth_of(const Part& part, const HelloMessage& hello) {
  const Camera& camera = hello.rig.depth;
  const auto meters = static_cast<float>(1.0 / hello.depth_scale);
  if (part.format == "png") {
    const cv::Mat image = decoded(part, "depth", camera, Pixels::as_stored);
    if (image.type() != CV_16UC1) throw std::runtime_error("depth: the PNG is not gray of 16 bits");
    return depth_in_meters(image.data, camera.width, camera.height, static_cast<int>(image.step[0]), meters);
  }
  check_raw_size(part, "depth", camera, part.format == "uint16" ? sizeof(std::uint16_t) : sizeof(float));
  if (part.format == "float32") return float_depth(part.bytes, camera);
  const int row = camera.width * static_cast<int>(sizeof(std::uint16_t));
  return depth_in_meters(part.bytes.data(), camera.width, camera.height, row, meters);
}

std::vector<std::uint32_t> color_of(const Part& part, const Camera& camera) {
  if (part.format.empty()) return {};
  if (part.format != "rgb8") return color_pixels(decoded(part, "color", camera, Pixels::rgba));
  check_raw_size(part, "color", camera, 3);
  std::vector<std::uint32_t> color(pixels(camera), 0xffffffff);
  for (std::size_t i = 0; i < color.size(); ++i) std::memcpy(&color[i], &part.bytes[3 * i], 3);
  return color;
}

std::vector<std::uint8_t> confidence_of(const Part& part, const Camera& camera) {
  if (part.format.empty()) return {};
  if (part.format != "png") {
    check_raw_size(part, "confidence", camera, 1);
    return {part.bytes.begin(), part.bytes.end()};
  }
  const cv::Mat image = decoded(part, "confidence", camera, Pixels::as_stored);
  if (image.type() != CV_8UC1) throw std::runtime_error("confidence: the PNG is not gray of 8 bits");
  std::vector<std::uint8_t> confidence;
  for (int y = 0; y < image.rows; ++y)
    confidence.insert(confidence.end(), image.ptr<std::uint8_t>(y), image.ptr<std::uint8_t>(y) + image.cols);
  return confidence;
}

std::optional<Eigen::Isometry3d> pose_of(const Json& header, const HelloMessage& hello, double timestamp) {
  const Json* pose = find(header, "pose");
  if (pose == nullptr) return std::nullopt;
  if (!hello.poses) throw std::runtime_error("`pose`: the hello announced no poses: send \"poses\": true in it");
  constexpr double kOne = 1 + kUnitTolerance, kFar = kMaxTranslation;
  const auto v = numbers<7>(*pose, "pose", {kFar, kFar, kFar, kOne, kOne, kOne, kOne}, "tx ty tz qx qy qz qw");
  StampedPose stamped{.timestamp = timestamp};
  const Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
  if (!(std::abs(rotation.norm() - 1) <= kUnitTolerance))
    throw std::runtime_error(fmt::format("`pose`: its quaternion has length {}, not 1", rotation.norm()));
  stamped.world_from_camera.linear() = rotation.normalized().toRotationMatrix();
  stamped.world_from_camera.translation() = Eigen::Vector3d(v[0], v[1], v[2]);
  const Eigen::Isometry3d converted = with_convention({stamped}, *hello.poses).front().world_from_camera;
  if (!(converted.translation().norm() <= kFar))
    throw std::runtime_error(fmt::format("`pose` is {:g} m from the origin, allowed: {:g}: check its unit in the hello",
                                         converted.translation().norm(), kFar));
  return converted;
}

/// Samples [[time, x, y, z], ...] of an inertial sensor.
std::vector<std::array<double, 4>> samples_of(const Json& header, const char* name) {
  const Json* samples = find(header, name);
  if (samples == nullptr) return {};
  if (!samples->is_array() || samples->size() > kMaxMotionSamples)
    throw std::runtime_error(
        fmt::format("`{}` takes at most {} samples [time, x, y, z] per frame", name, kMaxMotionSamples));
  std::vector<std::array<double, 4>> read;
  for (const Json& sample : *samples)
    read.push_back(numbers<4>(sample, name, {kMaxTime, kMaxMotion, kMaxMotion, kMaxMotion}, "[time, x, y, z]"));
  return read;
}

void read_motion(const Json& header, const HelloMessage& hello, FrameMessage& frame) {
  const auto rates = samples_of(header, "gyro"), accelerations = samples_of(header, "accel");
  if (!frame.has_timestamp && !(rates.empty() && accelerations.empty()))
    throw std::runtime_error("`gyro` and `accel` need `time` in the frame, in the same clock");
  if (!accelerations.empty() && !hello.rig.camera_from_imu)
    throw std::runtime_error("`accel` needs the rotation of the inertial sensor: `imu` in the hello's camera");
  for (const auto& [time, x, y, z] : rates) frame.images.rates.push_back({time, {x, y, z}});
  for (const auto& [time, x, y, z] : accelerations)
    frame.images.accelerations.push_back({time, *hello.rig.camera_from_imu * Eigen::Vector3d(x, y, z)});
}

/// Number and time, after those of the last frame.
void read_order(const Json& header, const FrameOrder& before, FrameMessage& frame) {
  const Json* number_json = find(header, "frame");
  if (number_json == nullptr || !number_json->is_number_unsigned() ||
      number_json->get<std::uint64_t>() > static_cast<std::uint64_t>(kMaxFrameNumber))
    throw std::runtime_error(fmt::format("`frame` is not a number from 0 to {}", kMaxFrameNumber));
  frame.images.number = number_json->get<std::int64_t>();
  if (frame.images.number <= before.number)
    throw std::runtime_error(fmt::format("`frame` is {} after {}: numbers increase from frame to frame",
                                         frame.images.number, before.number));
  const Json* time = find(header, "time");
  frame.has_timestamp = time != nullptr;
  if (before.number >= 0 && frame.has_timestamp != before.timestamp.has_value())
    throw std::runtime_error("`time` is in some frames only: send it in all frames, or in none");
  if (time == nullptr) return;
  frame.images.timestamp = number(*time, "time", kMaxTime);
  if (before.timestamp && !(frame.images.timestamp > *before.timestamp))
    throw std::runtime_error(fmt::format("`time` is {} after {}: seconds that increase from frame to frame",
                                         frame.images.timestamp, *before.timestamp));
}

}  // namespace

HelloMessage read_hello(Bytes message) {
  const auto [header, data] = parts_of(message);
  const Json* version = find(header, "cairn");
  if (version == nullptr || *version != Json(kFrameProtocol))
    throw std::runtime_error(
        fmt::format("the first message is not a hello of version {}: send {{\"cairn\": {}, "
                    "\"camera\": {{...}}}}",
                    kFrameProtocol, kFrameProtocol));
  check_keys(header, "hello", {"cairn", "camera", "poses", "token", "name"});
  if (!data.empty()) throw std::runtime_error(fmt::format("the hello has {} bytes after its header", data.size()));
  HelloMessage hello;
  hello.token = text_at(header, "token");
  hello.name = shown(text_at(header, "name"));
  hello.poses = poses_of(header);
  read_camera(header, hello);
  return hello;
}

std::size_t max_message_size(const HelloMessage& hello) {
  constexpr std::size_t kDepthAndConfidence = sizeof(float) + 1, kColor = 4;  // bytes per pixel
  return kPrefix + kMaxFrameHeader + pixels(hello.rig.depth) * kDepthAndConfidence +
         pixels(hello.rig.color_view()) * kColor;
}

FrameMessage read_frame(Bytes message, const HelloMessage& hello, const FrameOrder& before) {
  auto [header, data] = parts_of(message);
  FrameMessage frame;
  if (header.contains("cairn"))
    throw std::runtime_error("a second hello: disconnect, and connect again to change the camera");
  if (const Json* end = find(header, "end"); end != nullptr && *end == Json(true)) {
    frame.is_end = true;
    return frame;
  }
  check_keys(header, "frame", {"frame", "time", "depth", "color", "confidence", "pose", "gyro", "accel", "end"});
  read_order(header, before, frame);
  const Part depth = take_part(header, "depth", {"png", "uint16", "float32"}, data);
  const Part color = take_part(header, "color", {"jpeg", "png", "rgb8"}, data);
  const Part confidence = take_part(header, "confidence", {"png", "uint8"}, data);
  if (depth.format.empty()) throw std::runtime_error("`depth` is missing");
  if (!data.empty()) throw std::runtime_error(fmt::format("{} bytes follow the last part", data.size()));
  if (const Json* part = find(header, "color"))
    if (const Json* delay = find(*part, "delay")) frame.images.color_delay = number(*delay, "delay", kMaxDelay);
  frame.images.guess = pose_of(header, hello, frame.images.timestamp);
  read_motion(header, hello, frame);
  frame.images.depth = depth_of(depth, hello);
  frame.images.color = color_of(color, hello.rig.color_view());
  frame.images.confidence = confidence_of(confidence, hello.rig.depth);
  return frame;
}

}  // namespace cairn
