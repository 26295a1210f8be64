// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// RealSense cameras by librealsense2, loaded when the first is opened. The only file with librealsense2 calls.
#include "io/sensors/realsense.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "base/runtime_library.hpp"
#include "base/words.hpp"
#include "geometry/inverse_distortion.hpp"
#include "io/sensors/realsense_api.hpp"
#include "io/sensors/sensor_source.hpp"

namespace cairn {
namespace {

using namespace realsense;
constexpr int kMinVersion = 22400;     // 2.24.0: the camera's product line
constexpr int kNewestMinor = 99;       // of the library's file name
constexpr std::size_t kMaxQueued = 8;  // sets of images; the library keeps 16
constexpr int kPreferredRate = 30;     // Hz

struct Functions {
#define CAIRN_DECLARE(name) decltype(&::name) name = nullptr;  // NOLINT(bugprone-macro-parentheses): a member's name
  CAIRN_REALSENSE(CAIRN_DECLARE)
#undef CAIRN_DECLARE
};

Functions load() {
  std::vector<std::string> files{"librealsense2.so"};
  for (int minor = kNewestMinor; minor >= kMinVersion / 100 % 100; --minor)
    files.push_back(fmt::format("librealsense2.so.2.{}", minor));
  const LibraryErrors errors{.need = "RealSense cameras need librealsense2",
                             .install = "install it (https://github.com/IntelRealSense/librealsense)",
                             .update = "install version 2.24 or later"};
  const RuntimeLibrary library(files, errors);
  Functions f;
  library.find("rs2_get_api_version", f.rs2_get_api_version);
  if (const int version = f.rs2_get_api_version(nullptr); version < kMinVersion || version >= 30000)
    throw std::runtime_error(fmt::format("{}, and the installed version is {}.{}.{}: install version 2.24 or later",
                                         errors.need, version / 10000, version / 100 % 100, version % 100));
#define CAIRN_FIND(name) library.find(#name, f.name);
  CAIRN_REALSENSE(CAIRN_FIND)
#undef CAIRN_FIND
  return f;
}

const Functions& rs() {
  static const Functions loaded = load();
  return loaded;
}

/// Calls a function with its last argument, the error, and throws the error.
template <class R, class... P, class... A>
R call(R (*function)(P...), A... arguments) {
  struct Check {
    rs2_error* error = nullptr;
    void operator()() const {
      if (error == nullptr) return;
      const std::string message = rs().rs2_get_error_message(error);
      rs().rs2_free_error(error);
      throw std::runtime_error(shown(message));
    }
  } check;
  if constexpr (std::is_void_v<R>) {
    function(arguments..., &check.error);
    check();
  } else {
    R result = function(arguments..., &check.error);
    check();
    return result;
  }
}

template <class T>
using Owned = std::unique_ptr<T, void (*)(T*)>;

Owned<rs2_frame> owned(rs2_frame* frame) { return {frame, rs().rs2_release_frame}; }

/// The library's context, until the end of the program: it watches the USB ports.
rs2_context* context() {
  static rs2_context* const created = call(rs().rs2_create_context, rs().rs2_get_api_version(nullptr));
  return created;
}

std::string info_of(const rs2_device* device, Info info) {
  const bool has_info = call(rs().rs2_supports_device_info, device, static_cast<int>(info)) != 0;
  return has_info ? shown(call(rs().rs2_get_device_info, device, static_cast<int>(info))) : std::string();
}

std::vector<Owned<rs2_device>> connected_devices() {
  const Owned<rs2_device_list> list(call(rs().rs2_query_devices, static_cast<const rs2_context*>(context())),
                                    rs().rs2_delete_device_list);
  const int count = call(rs().rs2_get_device_count, list.get());
  std::vector<Owned<rs2_device>> devices;
  devices.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    devices.emplace_back(call(rs().rs2_create_device, list.get(), i), rs().rs2_delete_device);
  return devices;
}

/// Throws with the connected serial numbers if there is no such device.
Owned<rs2_device> device_with(const std::string& serial) {
  std::vector<std::string> others;
  for (auto& device : connected_devices()) {
    const std::string number = info_of(device.get(), kSerialNumber);
    if (serial.empty() || number == serial) return std::move(device);
    others.push_back(number);
  }
  if (others.empty())
    throw std::runtime_error(
        "no RealSense camera is plugged in; check with `lsusb`, and the udev rules of librealsense2");
  throw std::runtime_error("no RealSense camera has this serial number; plugged in: " +
                           fmt::format("{}", fmt::join(others, ", ")));
}

/// A mode of a stream. Motion has no size.
struct Mode {
  int stream = 0, format = 0, rate = 0, width = 0, height = 0;
};

/// Position in the list of preferred sizes: lower is better; its length: not in the list.
std::size_t rank_of(const Mode& mode) {
  struct Size {
    int width, height;
  };
  // Depth of D4xx is best at 848x480 (1280x720 for D415); L5xx has 640x480 and 1024x768.
  constexpr std::array kDepthSizes{Size{848, 480}, Size{640, 480}, Size{1024, 768}, Size{1280, 720}, Size{480, 270}};
  constexpr std::array kColorSizes{Size{1280, 720}, Size{848, 480}, Size{640, 480}, Size{1920, 1080}, Size{424, 240}};
  const auto& sizes = mode.stream == kDepth ? kDepthSizes : kColorSizes;
  return static_cast<std::size_t>(
      std::find_if(sizes.begin(), sizes.end(),
                   [&](const Size& size) { return size.width == mode.width && size.height == mode.height; }) -
      sizes.begin());
}

/// True if a mode is preferred: 30 Hz, else the highest rate; then the size. Motion: the lowest rate of at least 100
/// Hz.
bool is_better(const Mode& a, const Mode& b) {
  if (a.format == kMotion) return a.rate >= 100 && (b.rate < 100 || a.rate < b.rate);
  const auto distance = [](const Mode& mode) {
    return mode.rate <= kPreferredRate ? kPreferredRate - mode.rate : mode.rate;
  };
  return std::pair(distance(a), rank_of(a)) < std::pair(distance(b), rank_of(b));
}

/// Camera of one serial number: its modes and its depth unit.
struct Capabilities {
  std::optional<Mode> depth, color, gyro, accelerometer;
  float depth_unit = 0;  // meters
};

void add_mode(const rs2_stream_profile* profile, Capabilities& capabilities) {
  Mode mode;
  int index = 0, id = 0;
  call(rs().rs2_get_stream_profile_data, profile, &mode.stream, &mode.format, &index, &id, &mode.rate);
  std::optional<Mode>* best = nullptr;
  if (mode.stream == kDepth && mode.format == kZ16) best = &capabilities.depth;
  if (mode.stream == kColor && mode.format == kRgb8) best = &capabilities.color;
  if (mode.stream == kGyro && mode.format == kMotion) best = &capabilities.gyro;
  if (mode.stream == kAccelerometer && mode.format == kMotion) best = &capabilities.accelerometer;
  if (best == nullptr) return;
  if (mode.format != kMotion) call(rs().rs2_get_video_stream_resolution, profile, &mode.width, &mode.height);
  if (!*best || is_better(mode, **best)) *best = mode;
}

Capabilities capabilities_of(const rs2_device* device) {
  Capabilities capabilities;
  const Owned<rs2_sensor_list> sensors(call(rs().rs2_query_sensors, device), rs().rs2_delete_sensor_list);
  for (int i = 0; i < call(rs().rs2_get_sensors_count, sensors.get()); ++i) {
    const Owned<rs2_sensor> sensor(call(rs().rs2_create_sensor, sensors.get(), i), rs().rs2_delete_sensor);
    if (call(rs().rs2_is_sensor_extendable_to, sensor.get(), static_cast<int>(kDepthSensor)) != 0)
      capabilities.depth_unit = call(rs().rs2_get_depth_scale, sensor.get());
    const Owned<rs2_stream_profile_list> profiles(call(rs().rs2_get_stream_profiles, sensor.get()),
                                                  rs().rs2_delete_stream_profiles_list);
    for (int k = 0; k < call(rs().rs2_get_stream_profiles_count, profiles.get()); ++k)
      add_mode(call(rs().rs2_get_stream_profile, profiles.get(), k), capabilities);
  }
  if (!capabilities.depth || !(capabilities.depth_unit > 0))
    throw std::runtime_error("has no depth images; tracking cameras (T2xx) are not supported");
  return capabilities;
}

Camera camera_of(const rs2_stream_profile* profile) {
  rs2_intrinsics in{};
  call(rs().rs2_get_video_stream_intrinsics, profile, &in);
  Camera camera{.width = in.width, .height = in.height, .fx = in.fx, .fy = in.fy, .cx = in.ppx, .cy = in.ppy};
  const auto& k = in.coeffs;
  if (in.model == kNone || std::all_of(std::begin(k), std::end(k), [](float c) { return c == 0; })) return camera;
  if (in.model == kBrown || in.model == kModifiedBrown)
    camera.distortion = {k[0], k[1], k[2], k[3], k[4]};
  else if (in.model == kInverseBrown)
    camera.distortion = invert_distortion(camera, {k[0], k[1], k[2], k[3], k[4]});
  else if (in.model == kKannalaBrandt)
    camera.distortion = {k[0], k[1], k[2], k[3]}, camera.lens = Lens::fisheye;
  else
    throw std::runtime_error(fmt::format("its lens has the model {}, which is not supported", in.model));
  return camera;
}

Eigen::Isometry3d pose_between(const rs2_stream_profile* from, const rs2_stream_profile* to) {
  rs2_extrinsics extrinsics{};
  call(rs().rs2_get_extrinsics, from, to, &extrinsics);
  Eigen::Isometry3d to_from_from = Eigen::Isometry3d::Identity();
  const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix3f>(extrinsics.rotation).cast<double>();
  to_from_from.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  to_from_from.translation() = Eigen::Map<const Eigen::Vector3f>(extrinsics.translation).cast<double>();
  return to_from_from;
}

SensorModel sensor_model_of(const std::string& product_line) {
  if (product_line == "L500") return sensor_model("time_of_flight");
  return sensor_model(product_line == "SR300" ? "structured_light" : "stereo");
}

int stream_of(const rs2_stream_profile* profile) {
  int stream = 0, format = 0, index = 0, id = 0, rate = 0;
  call(rs().rs2_get_stream_profile_data, profile, &stream, &format, &index, &id, &rate);
  return stream;
}

/// Frames from the library's threads until the reader takes them.
class FrameQueue {
 public:
  /// A sample of an inertial sensor, in its own frame.
  struct Motion {
    int stream, clock;
    double timestamp;  // seconds
    Eigen::Vector3d value;
  };
  struct Taken {
    Owned<rs2_frame> images;
    std::vector<Motion> motion;  // since the previous images
  };

  /// Callback of the library.
  static void on_frame(rs2_frame* frame, void* queue) {
    try {
      static_cast<FrameQueue*>(queue)->put(owned(frame));
    } catch (const std::exception&) {
      // An unreadable frame counts as dropped.
    }
  }
  std::optional<Taken> take(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, timeout, [&] { return !images_.empty(); })) return std::nullopt;
    Taken taken{std::move(images_.front()), std::exchange(motion_, {})};
    images_.pop_front();
    return taken;
  }

 private:
  void put(Owned<rs2_frame> frame) {
    const int stream = stream_of(call(rs().rs2_get_frame_stream_profile, std::as_const(frame).get()));
    const bool is_motion = stream == kGyro || stream == kAccelerometer;
    Owned<rs2_frame> oldest = owned(nullptr);
    const std::lock_guard lock(mutex_);
    if (is_motion) {
      motion_.push_back(motion_in(frame.get(), stream));
      return;
    }
    images_.push_back(std::move(frame));
    if (images_.size() > kMaxQueued) {
      oldest = std::move(images_.front());
      images_.pop_front();
    }
    changed_.notify_one();
  }
  static Motion motion_in(const rs2_frame* frame, int stream) {
    float value[3];
    std::memcpy(value, call(rs().rs2_get_frame_data, frame), sizeof value);
    return {stream, call(rs().rs2_get_frame_timestamp_domain, frame), call(rs().rs2_get_frame_timestamp, frame) / 1e3,
            Eigen::Vector3d(value[0], value[1], value[2])};
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Owned<rs2_frame>> images_;
  std::vector<Motion> motion_;
};

class RealSense final : public SensorDevice {
 public:
  explicit RealSense(const std::string& serial) {
    const Owned<rs2_device> device = device_with(serial);
    serial_ = info_of(device.get(), kSerialNumber);
    const Capabilities capabilities = capabilities_of(device.get());
    depth_unit_ = capabilities.depth_unit;
    start(capabilities);
    rig_.sensor = sensor_model_of(info_of(device.get(), kProductLine));
  }
  ~RealSense() override {
    rs2_error* ignored = nullptr;
    rs().rs2_pipeline_stop(pipeline_.get(), &ignored);
    if (ignored != nullptr) rs().rs2_free_error(ignored);
  }
  RealSense(const RealSense&) = delete;
  RealSense& operator=(const RealSense&) = delete;

  const Rig& rig() const override { return rig_; }
  std::string serial() const override { return serial_; }

  std::optional<SensorImages> next(std::chrono::milliseconds timeout) override {
    while (auto taken = queue_.take(timeout)) {
      try {
        if (auto images = images_in(taken->images.get())) {
          attach_motion(taken->motion, *images);
          return images;
        }
      } catch (const std::runtime_error&) {
        // An unreadable set of images counts as dropped.
      }
    }
    return std::nullopt;
  }

 private:
  void start(const Capabilities& capabilities) {
    const Owned<rs2_config> config(call(rs().rs2_create_config), rs().rs2_delete_config);
    call(rs().rs2_config_enable_device, config.get(), serial_.c_str());
    for (const auto& mode : {capabilities.depth, capabilities.color, capabilities.gyro, capabilities.accelerometer})
      if (mode)
        call(rs().rs2_config_enable_stream, config.get(), mode->stream, -1, mode->width, mode->height, mode->format,
             mode->rate);
    pipeline_ = {call(rs().rs2_create_pipeline, context()), rs().rs2_delete_pipeline};
    Owned<rs2_pipeline_profile> profile(nullptr, rs().rs2_delete_pipeline_profile);
    try {
      profile.reset(call(rs().rs2_pipeline_start_with_config_and_callback, pipeline_.get(), config.get(),
                         &FrameQueue::on_frame, static_cast<void*>(&queue_)));
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(std::string("cannot be started; is another program using it? ") + error.what());
    }
    read_cameras(profile.get());
  }

  void read_cameras(rs2_pipeline_profile* pipeline) {
    const Owned<rs2_stream_profile_list> list(call(rs().rs2_pipeline_profile_get_streams, pipeline),
                                              rs().rs2_delete_stream_profiles_list);
    std::array<const rs2_stream_profile*, 8> profiles{};  // by stream
    for (int i = 0; i < call(rs().rs2_get_stream_profiles_count, list.get()); ++i) {
      const rs2_stream_profile* profile = call(rs().rs2_get_stream_profile, list.get(), i);
      if (const auto stream = static_cast<std::size_t>(stream_of(profile)); stream < profiles.size())
        profiles[stream] = profile;
    }
    const auto* depth = profiles[kDepth];
    if (depth == nullptr) throw std::runtime_error("has no depth images");
    rig_ = camera_of(depth);
    if (const auto* color = profiles[kColor]; color != nullptr)
      rig_.color = {camera_of(color), pose_between(depth, color)};
    if (const auto* gyro = profiles[kGyro]; gyro != nullptr)
      rig_.camera_from_imu = Eigen::Quaterniond(pose_between(gyro, depth).linear());
    if (const auto* accelerometer = profiles[kAccelerometer]; accelerometer != nullptr)
      depth_from_accelerometer_ = pose_between(accelerometer, depth).linear();
  }

  /// Empty without a depth image.
  std::optional<SensorImages> images_in(rs2_frame* set) {
    std::vector<Owned<rs2_frame>> parts;
    const bool is_set = call(rs().rs2_is_frame_extendable_to, static_cast<const rs2_frame*>(set),
                             static_cast<int>(kCompositeFrame)) != 0;
    for (int i = 0; is_set && i < call(rs().rs2_embedded_frames_count, set); ++i)
      parts.push_back(owned(call(rs().rs2_extract_frame, set, i)));
    const rs2_frame *depth = nullptr, *color = nullptr;
    const auto add = [&](const rs2_frame* frame) {
      const int stream = stream_of(call(rs().rs2_get_frame_stream_profile, frame));
      if (stream == kDepth) depth = frame;
      if (stream == kColor) color = frame;
    };
    if (!is_set) add(set);
    for (const auto& part : parts) add(part.get());
    if (depth == nullptr) return std::nullopt;
    SensorImages images{.timestamp = seconds(depth),
                        .number = static_cast<std::int64_t>(call(rs().rs2_get_frame_number, depth))};
    clock_ = call(rs().rs2_get_frame_timestamp_domain, depth);
    if (has_size(depth, rig_.depth, 2))
      images.depth = depth_in_meters(call(rs().rs2_get_frame_data, depth), rig_.depth.width, rig_.depth.height,
                                     call(rs().rs2_get_frame_stride_in_bytes, depth), depth_unit_);
    if (color != nullptr && rig_.color && has_size(color, rig_.color->camera, 3)) {
      images.color =
          color_words(call(rs().rs2_get_frame_data, color), rig_.color->camera.width, rig_.color->camera.height,
                      call(rs().rs2_get_frame_stride_in_bytes, color), ColorBytes::rgb);
      if (call(rs().rs2_get_frame_timestamp_domain, color) == clock_)
        images.color_delay = seconds(color) - images.timestamp;
    }
    return images;
  }

  /// Samples in another clock than the images' are not used.
  void attach_motion(const std::vector<FrameQueue::Motion>& motion, SensorImages& images) const {
    for (const auto& sample : motion) {
      if (sample.clock != clock_) continue;
      if (sample.stream == kGyro)
        images.rates.push_back({sample.timestamp, sample.value});
      else
        images.accelerations.push_back({sample.timestamp, depth_from_accelerometer_ * sample.value});
    }
  }

  static double seconds(const rs2_frame* frame) { return call(rs().rs2_get_frame_timestamp, frame) / 1e3; }
  static bool has_size(const rs2_frame* frame, const Camera& camera, int bytes_per_pixel) {
    return call(rs().rs2_get_frame_width, frame) == camera.width &&
           call(rs().rs2_get_frame_height, frame) == camera.height &&
           call(rs().rs2_get_frame_stride_in_bytes, frame) >= camera.width * bytes_per_pixel &&
           call(rs().rs2_get_frame_data, frame) != nullptr;
  }

  std::string serial_;
  Rig rig_;
  Eigen::Matrix3d depth_from_accelerometer_ = Eigen::Matrix3d::Identity();
  float depth_unit_ = 0;  // meters
  int clock_ = 0;         // domain of the timestamps
  FrameQueue queue_;      // outlives the pipeline
  Owned<rs2_pipeline> pipeline_{nullptr, rs().rs2_delete_pipeline};
};

}  // namespace

std::unique_ptr<Source> open_realsense(const std::string& serial) {
  return sensor_source("realsense", "RealSense camera", serial,
                       [](const std::string& number) { return std::make_unique<RealSense>(number); });
}

std::vector<SensorInfo> list_realsense() {
  std::vector<SensorInfo> sensors;
  for (const auto& device : connected_devices())
    sensors.push_back({"realsense:" + info_of(device.get(), kSerialNumber), info_of(device.get(), kName)});
  return sensors;
}

}  // namespace cairn
