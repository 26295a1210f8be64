// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Azure Kinect and Orbbec Femto by libk4a, loaded when the first is opened. The only file with libk4a calls.
#include "io/sensors/k4a.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include "base/runtime_library.hpp"
#include "base/words.hpp"
#include "io/sensors/k4a_api.hpp"
#include "io/sensors/sensor_source.hpp"

namespace cairn {
namespace {

using namespace k4a;
constexpr double kRate = 30;      // Hz
constexpr float kMeters = 1e-3f;  // per depth unit
const std::array<std::string, 4> kFiles{"libk4a.so", "libk4a.so.1.4", "libk4a.so.1.3", "libk4a.so.1.2"};

struct Functions {
#define CAIRN_DECLARE(name) decltype(&::name) name = nullptr;  // NOLINT(bugprone-macro-parentheses): a member's name
  CAIRN_K4A(CAIRN_DECLARE)
#undef CAIRN_DECLARE
};

Functions load() {
  setenv("K4A_ENABLE_LOG_TO_STDOUT", "0", 0);  // stdout belongs to the program's results
  const RuntimeLibrary library(
      kFiles, {.need = "Azure Kinect and Femto need libk4a",
               .install = "install it (https://github.com/microsoft/Azure-Kinect-Sensor-SDK; for Femto "
                          "https://github.com/orbbec/OrbbecSDK-K4A-Wrapper)",
               .update = "install version 1.2 or later"});
  Functions f;
#define CAIRN_FIND(name) library.find(#name, f.name);
  CAIRN_K4A(CAIRN_FIND)
#undef CAIRN_FIND
  return f;
}

const Functions& api() {
  static const Functions loaded = load();
  return loaded;
}

/// Object of the library; null: none.
template <class T>
using Owned = std::unique_ptr<T, void (*)(T*)>;
using Device = Owned<_k4a_device_t>;
using Image = Owned<_k4a_image_t>;

/// Null if the device cannot be opened.
Device open_device(std::uint32_t index) {
  k4a_device_t device = nullptr;
  const bool is_open = api().k4a_device_open(index, &device) == kSucceeded;
  return {is_open ? device : nullptr, api().k4a_device_close};
}

std::string serial_of(k4a_device_t device) {
  std::size_t size = 0;
  if (api().k4a_device_get_serialnum(device, nullptr, &size) != kTooSmall || size == 0) return {};
  std::string serial(size, '\0');
  if (api().k4a_device_get_serialnum(device, serial.data(), &size) != kSucceeded) return {};
  return shown(serial.substr(0, serial.find('\0')));
}

struct OpenDevice {
  Device device;
  std::string serial;
};

/// Throws with the connected serial numbers if there is no such device.
OpenDevice device_with(const std::string& serial) {
  const std::uint32_t count = api().k4a_device_get_installed_count();
  if (count == 0)
    throw std::runtime_error(
        "no Azure Kinect or Femto is plugged in; check with `lsusb`, its power supply, and the udev rules of libk4a");
  std::vector<std::string> others;
  for (std::uint32_t i = 0; i < count; ++i) {
    Device device = open_device(i);
    if (!device) continue;
    const std::string number = serial_of(device.get());
    if (serial.empty() || number == serial) return {std::move(device), number};
    others.push_back(number);
  }
  if (others.empty())
    throw std::runtime_error("cannot be opened; is another program using it? Else check the udev rules of libk4a");
  throw std::runtime_error(
      fmt::format("no Azure Kinect or Femto has this serial number; plugged in: {}", fmt::join(others, ", ")));
}

Camera camera_of(const k4a_calibration_camera_t& calibration) {
  const auto& in = calibration.intrinsics;
  const auto& p = in.parameters;
  if ((in.type != kBrownConrady && in.type != kRational6Kt) || p[10] != 0 || p[11] != 0)
    throw std::runtime_error(fmt::format("its lens has the model {}, which is not supported", in.type));
  return {.width = calibration.resolution_width,
          .height = calibration.resolution_height,
          .fx = p[2],
          .fy = p[3],
          .cx = p[0],
          .cy = p[1],
          .distortion = {p[4], p[5], p[13], p[12], p[6], p[7], p[8], p[9]}};
}

Eigen::Isometry3d pose_of(const k4a_calibration_extrinsics_t& extrinsics) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const Eigen::Matrix3d rotation =
      Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(extrinsics.rotation).cast<double>();
  pose.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  pose.translation() = 1e-3 * Eigen::Map<const Eigen::Vector3f>(extrinsics.translation).cast<double>();
  return pose;
}

double seconds(std::uint64_t microseconds) { return static_cast<double>(microseconds) / 1e6; }

class K4a final : public SensorDevice {
 public:
  explicit K4a(const std::string& serial) : K4a(device_with(serial)) {}
  ~K4a() override {
    if (has_imu_) api().k4a_device_stop_imu(device_.get());
    api().k4a_device_stop_cameras(device_.get());
  }
  K4a(const K4a&) = delete;
  K4a& operator=(const K4a&) = delete;

  const Rig& rig() const override { return rig_; }
  std::string serial() const override { return serial_; }

  std::optional<SensorImages> next(std::chrono::milliseconds timeout) override {
    const auto end = std::chrono::steady_clock::now() + timeout;
    while (std::chrono::steady_clock::now() < end) {
      k4a_capture_t taken = nullptr;
      if (api().k4a_device_get_capture(device_.get(), &taken, static_cast<int>(timeout.count())) != kSucceeded)
        return std::nullopt;
      const Owned<_k4a_capture_t> capture(taken, api().k4a_capture_release);
      const Image depth(api().k4a_capture_get_depth_image(taken), api().k4a_image_release);
      if (!depth) continue;
      return images_in(depth.get(), Image(api().k4a_capture_get_color_image(taken), api().k4a_image_release).get());
    }
    return std::nullopt;
  }

 private:
  explicit K4a(OpenDevice open) : serial_(std::move(open.serial)), device_(std::move(open.device)) {
    read_calibration();
    const k4a_device_configuration_t configuration{.color_format = kBgra32,
                                                   .color_resolution = kColor720p,
                                                   .depth_mode = kNarrow640x576,
                                                   .camera_fps = k30Hz,
                                                   .synchronized_images_only = false};
    if (api().k4a_device_start_cameras(device_.get(), &configuration) != kSucceeded)
      throw std::runtime_error(
          "cannot be started: plug it into a USB 3 port with its power supply, and install libdepthengine");
    has_imu_ = api().k4a_device_start_imu(device_.get()) == kSucceeded;
  }

  void read_calibration() {
    k4a_calibration_t calibration{};
    if (api().k4a_device_get_calibration(device_.get(), kNarrow640x576, kColor720p, &calibration) != kSucceeded)
      throw std::runtime_error("its calibration cannot be read; plug it in again");
    rig_ = camera_of(calibration.depth_camera_calibration);
    rig_.color = {camera_of(calibration.color_camera_calibration), pose_of(calibration.extrinsics[kDepth][kColor])};
    rig_.sensor = sensor_model("time_of_flight");
    rig_.camera_from_imu = Eigen::Quaterniond(pose_of(calibration.extrinsics[kGyro][kDepth]).linear());
    depth_from_accelerometer_ = pose_of(calibration.extrinsics[kAccelerometer][kDepth]).linear();
  }

  SensorImages images_in(k4a_image_t depth, k4a_image_t color) {
    SensorImages images{.timestamp = seconds(api().k4a_image_get_device_timestamp_usec(depth))};
    // libk4a counts no images: their number follows from the time.
    if (last_timestamp_) number_ += std::max(1L, std::lround(kRate * (images.timestamp - *last_timestamp_)));
    last_timestamp_ = images.timestamp;
    images.number = number_;
    if (has_size(depth, rig_.depth, 2))
      images.depth = depth_in_meters(api().k4a_image_get_buffer(depth), rig_.depth.width, rig_.depth.height,
                                     api().k4a_image_get_stride_bytes(depth), kMeters);
    if (color != nullptr && has_size(color, rig_.color->camera, 4)) {
      images.color = color_words(api().k4a_image_get_buffer(color), rig_.color->camera.width, rig_.color->camera.height,
                                 api().k4a_image_get_stride_bytes(color), ColorBytes::bgra);
      images.color_delay = seconds(api().k4a_image_get_device_timestamp_usec(color)) - images.timestamp;
    }
    read_motion(images);
    return images;
  }

  void read_motion(SensorImages& images) const {
    k4a_imu_sample_t sample{};
    while (has_imu_ && api().k4a_device_get_imu_sample(device_.get(), &sample, 0) == kSucceeded) {
      const auto vector = [](const float(&v)[3]) { return Eigen::Vector3d(v[0], v[1], v[2]); };
      images.rates.push_back({seconds(sample.gyro_timestamp_usec), vector(sample.gyro_sample)});
      images.accelerations.push_back(
          {seconds(sample.acc_timestamp_usec), depth_from_accelerometer_ * vector(sample.acc_sample)});
    }
  }

  static bool has_size(k4a_image_t image, const Camera& camera, int bytes_per_pixel) {
    const int stride = api().k4a_image_get_stride_bytes(image);
    return api().k4a_image_get_width_pixels(image) == camera.width &&
           api().k4a_image_get_height_pixels(image) == camera.height && stride >= camera.width * bytes_per_pixel &&
           api().k4a_image_get_buffer(image) != nullptr &&
           api().k4a_image_get_size(image) >=
               static_cast<std::size_t>(stride) * static_cast<std::size_t>(camera.height);
  }

  std::string serial_;
  Rig rig_;
  Eigen::Matrix3d depth_from_accelerometer_ = Eigen::Matrix3d::Identity();
  std::optional<double> last_timestamp_;  // of a depth image
  std::int64_t number_ = 0;
  bool has_imu_ = false;
  Device device_;
};

}  // namespace

std::unique_ptr<Source> open_k4a(const std::string& serial) {
  return sensor_source("k4a", "Azure Kinect or Femto", serial,
                       [](const std::string& number) { return std::make_unique<K4a>(number); });
}

std::vector<SensorInfo> list_k4a() {
  std::vector<SensorInfo> sensors;
  for (std::uint32_t i = 0; i < api().k4a_device_get_installed_count(); ++i) {
    const Device device = open_device(i);
    sensors.push_back(device ? SensorInfo{"k4a:" + serial_of(device.get()), "Azure Kinect or Femto"}
                             : SensorInfo{"k4a:", "Azure Kinect or Femto, in use by another program"});
  }
  return sensors;
}

}  // namespace cairn
