// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// OpenNI2 driver of a virtual depth camera for tests. CAIRN_SENSOR configures its behavior with these words:
//   frames=FOLDER  repeats FOLDER/depth-N.raw (16 bit, mm) and color-N.raw (RGB); default: a slanted wall
//   unplug=N       is unplugged after N images      busy     cannot be opened        nodepth   has no depth images
//   rate=HZ        images a second [30]             beside   cannot register depth to color
#include <Driver/OniDriverAPI.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <string>
#include <thread>

#include "support/sensor/played_images.hpp"

#define XN_NEW(type, ...) new type(__VA_ARGS__)
#define XN_DELETE(pointer) delete pointer

namespace {

constexpr int kWidth = 640, kHeight = 480;
constexpr const char* kUri = "virtual";

std::string setting(const std::string& name) { return virtual_sensor::setting("CAIRN_SENSOR", name); }

class Stream final : public oni::driver::StreamBase {
 public:
  Stream(bool is_depth, const virtual_sensor::PlayedImages& images, std::atomic<int>& shown)
      : is_depth_(is_depth), images_(images), shown_(shown) {}
  ~Stream() override { stop(); }

  OniStatus start() override {
    running_ = true;
    thread_ = std::thread([this] { show(); });
    return ONI_STATUS_OK;
  }
  void stop() override {
    running_ = false;
    if (thread_.joinable()) thread_.join();
  }
  static OniVideoMode mode(bool is_depth) {
    return {is_depth ? ONI_PIXEL_FORMAT_DEPTH_1_MM : ONI_PIXEL_FORMAT_RGB888, kWidth, kHeight, 30};
  }
  OniBool isPropertySupported(int id) override {
    return id == ONI_STREAM_PROPERTY_VIDEO_MODE || id == ONI_STREAM_PROPERTY_HORIZONTAL_FOV ||
           id == ONI_STREAM_PROPERTY_VERTICAL_FOV || id == ONI_STREAM_PROPERTY_MIRRORING ||
           id == ONI_STREAM_PROPERTY_CROPPING;
  }
  OniStatus getProperty(int id, void* data, int* size) override {
    const auto give = [&](const auto& value) {
      if (*size < static_cast<int>(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
      std::memcpy(data, &value, sizeof value);
      *size = sizeof value;
      return ONI_STATUS_OK;
    };
    switch (id) {
      case ONI_STREAM_PROPERTY_VIDEO_MODE:
        return give(mode(is_depth_));
      case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
        return give(2 * std::atan(kWidth / 2.0f / 525.0f));
      case ONI_STREAM_PROPERTY_VERTICAL_FOV:
        return give(2 * std::atan(kHeight / 2.0f / 525.0f));
      case ONI_STREAM_PROPERTY_CROPPING:  // required to play back a recording of the sensor
        return give(OniCropping{FALSE, 0, 0, kWidth, kHeight});
      case ONI_STREAM_PROPERTY_MIRRORING:
        return give(mirrored_);
      case ONI_STREAM_PROPERTY_MAX_VALUE:
        return give(10000);
      default:
        return ONI_STATUS_NOT_IMPLEMENTED;
    }
  }
  OniStatus setProperty(int id, const void* data, int size) override {
    if (id == ONI_STREAM_PROPERTY_MIRRORING && size == static_cast<int>(sizeof mirrored_)) {
      std::memcpy(&mirrored_, data, sizeof mirrored_);
      return ONI_STATUS_OK;
    }
    return id == ONI_STREAM_PROPERTY_VIDEO_MODE ? ONI_STATUS_OK : ONI_STATUS_NOT_IMPLEMENTED;
  }

 private:
  void show() {
    const std::string rate = setting("rate");
    const std::chrono::duration<double> period(1 / (rate.empty() ? 30.0 : std::stod(rate)));
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 1; running_; ++i) {
      std::this_thread::sleep_until(begin +
                                    std::chrono::duration_cast<std::chrono::steady_clock::duration>(i * period));
      if (is_depth_) ++shown_;
      OniFrame* frame = getServices().acquireFrame();
      if (frame == nullptr) continue;
      const auto& all = is_depth_ ? images_.depth : images_.color;
      const auto& image = all[static_cast<std::size_t>(i - 1) % all.size()];
      frame->frameIndex = i;
      frame->timestamp = static_cast<std::uint64_t>(i * period.count() * 1e6);
      frame->videoMode = mode(is_depth_);
      frame->width = kWidth, frame->height = kHeight;
      frame->cropOriginX = frame->cropOriginY = 0;
      frame->croppingEnabled = FALSE;
      frame->sensorType = is_depth_ ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR;
      frame->stride = static_cast<int>(image.size()) / kHeight;
      std::memcpy(frame->data, image.data(), std::min(image.size(), static_cast<std::size_t>(frame->dataSize)));
      frame->dataSize = static_cast<int>(image.size());
      raiseNewFrame(frame);
      getServices().releaseFrame(frame);
    }
  }

  bool is_depth_;
  const virtual_sensor::PlayedImages& images_;
  std::atomic<int>& shown_;
  std::atomic<bool> running_ = false;
  OniBool mirrored_ = FALSE;
  std::thread thread_;
};

class Device final : public oni::driver::DeviceBase {
 public:
  Device() {
    for (const bool is_depth : {true, false}) {
      modes_[is_depth] = Stream::mode(is_depth);
      if (is_depth && !setting("nodepth").empty()) continue;
      sensors_[count_++] = {is_depth ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR, 1, &modes_[is_depth]};
    }
  }
  OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override {
    *sensors = sensors_, *count = count_;
    return ONI_STATUS_OK;
  }
  oni::driver::StreamBase* createStream(OniSensorType type) override {
    return new Stream(type == ONI_SENSOR_DEPTH, images_, shown);
  }
  void destroyStream(oni::driver::StreamBase* stream) override { delete stream; }
  OniBool isImageRegistrationModeSupported(OniImageRegistrationMode mode) override {
    return mode == ONI_IMAGE_REGISTRATION_OFF || setting("beside").empty();
  }
  OniStatus setProperty(int id, const void*, int) override {
    return id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION ? ONI_STATUS_OK : ONI_STATUS_NOT_IMPLEMENTED;
  }
  std::atomic<int> shown = 0;  // depth images

 private:
  virtual_sensor::PlayedImages images_{setting("frames"), {kWidth, kHeight}, {kWidth, kHeight}};
  OniVideoMode modes_[2];
  OniSensorInfo sensors_[2];
  int count_ = 0;
};

class Driver final : public oni::driver::DriverBase {
 public:
  using DriverBase::DriverBase;
  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback changed, void* cookie) override {
    DriverBase::initialize(connected, disconnected, changed, cookie);
    std::strcpy(info_.uri, kUri);
    std::strcpy(info_.vendor, "Cairn");
    std::strcpy(info_.name, "virtual sensor");
    deviceConnected(&info_);
    return ONI_STATUS_OK;
  }
  oni::driver::DeviceBase* deviceOpen(const char*, const char*) override {
    if (!setting("busy").empty()) return nullptr;
    auto* device = new Device;
    if (const std::string images = setting("unplug"); !images.empty())
      watch_ = std::thread([this, device, count = std::stoi(images)] {
        while (device->shown < count && !closing_) std::this_thread::sleep_for(std::chrono::milliseconds(5));
        if (!closing_) deviceDisconnected(&info_);
      });
    return device;
  }
  void deviceClose(oni::driver::DeviceBase* device) override {
    closing_ = true;
    if (watch_.joinable()) watch_.join();
    delete device;
  }
  void shutdown() override {}

 private:
  OniDeviceInfo info_{};
  std::atomic<bool> closing_ = false;
  std::thread watch_;
};

}  // namespace

ONI_EXPORT_DRIVER(Driver)
