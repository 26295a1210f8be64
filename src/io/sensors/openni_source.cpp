// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// OpenNI2: sensors (PrimeSense, Xtion, the first Kinect) and recordings (.oni). The only file with OpenNI2 calls.
#include <OpenNI.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <deque>
#include <fstream>
#include <stdexcept>

#include "base/file_name.hpp"
#include "cairn/io/known_cameras.hpp"
#include "io/camera_file.hpp"
#include "io/sensors/oni_file.hpp"
#include "io/sensors/openni.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kTimeout = 2000;             // milliseconds without an image until a stream counts as ended
constexpr double kMaxColorDelay = 0.0175;  // seconds; a more distant color image belongs to another depth image

/// Initializes the library until the end of the program.
void start_openni() {
  struct Library {
    Library() {
      if (openni::OpenNI::initialize() != openni::STATUS_OK)
        throw std::runtime_error(std::string("OpenNI2 has no drivers: install libopenni2-0. ") +
                                 openni::OpenNI::getExtendedError());
    }
    ~Library() { openni::OpenNI::shutdown(); }
  };
  static const Library library;
}

/// True if the kernel lists a sensor supported by OpenNI2.
bool is_plugged_in() {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/sys/bus/usb/devices", ignored)) {
    const auto word = [&](const char* name) {
      std::string text;
      std::ifstream(entry.path() / name) >> text;
      return text;
    };
    const std::string vendor = word("idVendor");
    if (vendor == "1d27" || vendor == "2bc5" || (vendor == "045e" && word("idProduct") == "02ae")) return true;
  }
  return false;
}

std::string no_sensor_message() {
  return is_plugged_in()
             ? "a depth sensor is plugged in but cannot be opened: allow it with the udev rules of libopenni2-0 "
               "(/lib/udev/rules.d/60-libopenni2-0.rules, then plug it in again), or end the program that uses it"
             : "no depth sensor is plugged in that OpenNI2 supports (PrimeSense, Xtion, Kinect for Xbox 360); check "
               "with `lsusb`, or give a recording";
}

class Unplugged final : public openni::OpenNI::DeviceDisconnectedListener {
 public:
  explicit Unplugged(std::string uri) : uri_(std::move(uri)) { openni::OpenNI::addDeviceDisconnectedListener(this); }
  ~Unplugged() override { openni::OpenNI::removeDeviceDisconnectedListener(this); }
  void onDeviceDisconnected(const openni::DeviceInfo* info) override {
    happened_ = happened_ || uri_ == info->getUri();
  }
  [[nodiscard]] bool happened() const { return happened_; }

 private:
  std::string uri_;
  std::atomic<bool> happened_ = false;
};

/// Selects 640x480 at 30 Hz in the given format if the sensor supports it; keeps the current mode if not.
void choose_mode(openni::VideoStream& stream, openni::PixelFormat format) {
  const auto& modes = stream.getSensorInfo().getSupportedVideoModes();
  for (int i = 0; i < modes.getSize(); ++i)
    if (modes[i].getResolutionX() == 640 && modes[i].getResolutionY() == 480 && modes[i].getFps() == 30 &&
        modes[i].getPixelFormat() == format) {
      (void)stream.setVideoMode(modes[i]);
      return;
    }
}

Camera camera_of(const openni::VideoStream& depth, const std::string& name) {
  const auto mode = depth.getVideoMode();
  const double w = mode.getResolutionX(), h = mode.getResolutionY();
  // OpenNI2 measures from the image corner (CoordinateConverter), so its center is half a pixel before ours.
  Camera camera{.width = mode.getResolutionX(), .height = mode.getResolutionY(), .cx = w / 2, .cy = h / 2};
  camera.fx = w / 2 / std::tan(depth.getHorizontalFieldOfView() / 2.0);
  camera.fy = h / 2 / std::tan(depth.getVerticalFieldOfView() / 2.0);
  if (!(camera.fx > 0 && std::isfinite(camera.fx) && camera.fy > 0 && std::isfinite(camera.fy)))
    throw std::runtime_error(name +
                             ": has no field of view; give its intrinsics in a camera.yaml (SourceOptions::camera)");
  try {
    check(camera);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(name + ": " + error.what() + ", or give them in a camera.yaml (SourceOptions::camera)");
  }
  return camera;
}

double seconds(const openni::VideoFrameRef& image) { return static_cast<double>(image.getTimestamp()) * 1e-6; }

/// True if the data covers the image size: a file may declare any size.
bool is_complete(const openni::VideoFrameRef& image, int bytes_per_pixel) {
  const std::int64_t width = image.getWidth(), height = image.getHeight(), stride = image.getStrideInBytes();
  return width > 0 && height > 0 && stride >= width * bytes_per_pixel && image.getData() != nullptr &&
         stride * (height - 1) + width * bytes_per_pixel <= image.getDataSize();
}

/// Returns `pixel(source row, source column)` for each pixel; mirrored streams are flipped.
template <class T, class Pixel>
std::vector<T> pixels_of(const openni::VideoFrameRef& image, bool mirrored, Pixel&& pixel) {
  const int w = image.getWidth(), h = image.getHeight();
  std::vector<T> pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
  auto* to = pixels.data();
  for (int y = 0; y < h; ++y) {
    const auto* row =
        static_cast<const std::uint8_t*>(image.getData()) + static_cast<std::ptrdiff_t>(y) * image.getStrideInBytes();
    for (int x = 0; x < w; ++x) *to++ = pixel(row, mirrored ? w - 1 - x : x);
  }
  return pixels;
}

/// Depth in meters.
std::vector<float> depth_of(const openni::VideoFrameRef& image, bool mirrored, float unit) {
  return pixels_of<float>(image, mirrored, [unit](const std::uint8_t* row, int x) {
    std::uint16_t z;
    std::memcpy(&z, row + 2 * x, 2);
    return static_cast<float>(z) * unit;
  });
}

std::vector<std::uint32_t> color_of(const openni::VideoFrameRef& image, bool mirrored) {
  return pixels_of<std::uint32_t>(image, mirrored, [](const std::uint8_t* row, int x) {
    const std::uint8_t* p = row + 3 * x;
    return p[0] | std::uint32_t{p[1]} << 8 | std::uint32_t{p[2]} << 16 | 0xff000000u;
  });
}

/// Buffer of the latest color images.
class ColorImages {
 public:
  struct Image {
    double timestamp;  // seconds
    std::vector<std::uint32_t> pixels;
  };
  void add(Image image) {
    images_.push_back(std::move(image));
    if (images_.size() > 4) images_.pop_front();
  }
  /// True if no later image can be closer to this time than the buffered images.
  [[nodiscard]] bool covers(double timestamp) const {
    return !images_.empty() && images_.back().timestamp >= timestamp - kMaxColorDelay;
  }
  /// Returns the image closest in time; null if it belongs to another depth image.
  [[nodiscard]] const Image* nearest(double timestamp) const {
    const Image* nearest = nullptr;
    for (const Image& image : images_)
      if (nearest == nullptr || std::abs(image.timestamp - timestamp) < std::abs(nearest->timestamp - timestamp))
        nearest = &image;
    return nearest != nullptr && std::abs(nearest->timestamp - timestamp) > kMaxColorDelay ? nullptr : nearest;
  }

 private:
  std::deque<Image> images_;
};

class OpenNiSource final : public Source {
 public:
  OpenNiSource(const std::string& uri, const OpenNiOptions& options) : name_(uri.empty() ? "openni:" : uri) {
    start_openni();
    if (std::error_code ignored; extension_of(name_) == ".oni" && fs::is_regular_file(name_, ignored)) check_oni(name_);
    const auto opened = device_.open(uri.empty() ? openni::ANY_DEVICE : uri.c_str());
    if (opened != openni::STATUS_OK) fail(opened);
    if (device_.isFile() && device_.getPlaybackControl() == nullptr)
      throw std::runtime_error(name_ + ": cannot be played");
    if (!device_.hasSensor(openni::SENSOR_DEPTH) || depth_.create(device_, openni::SENSOR_DEPTH) != openni::STATUS_OK)
      throw std::runtime_error(name_ + ": has no depth images");
    has_color_ =
        device_.hasSensor(openni::SENSOR_COLOR) && color_.create(device_, openni::SENSOR_COLOR) == openni::STATUS_OK;
    if (!device_.isFile()) prepare_sensor();
    read_formats();
    if (options.camera.empty())
      rig_ = camera_of(depth_, name_);
    else
      use(camera_named(options.camera), options.camera);
    if (auto* playback = device_.getPlaybackControl()) prepare_file(*playback);
    unplugged_.emplace(device_.getDeviceInfo().getUri());
    if (!options.copy_to.empty()) copy_to(options.copy_to);
    if (depth_.start() != openni::STATUS_OK || (has_color_ && color_.start() != openni::STATUS_OK))
      fail(openni::STATUS_ERROR);
  }
  ~OpenNiSource() override {
    recorder_.stop();
    recorder_.destroy();
    depth_.stop();
    color_.stop();
  }
  OpenNiSource(const OpenNiSource&) = delete;
  OpenNiSource& operator=(const OpenNiSource&) = delete;

  const Rig& rig() const override { return rig_; }
  std::string layout() const override { return device_.isFile() ? "OpenNI .oni file" : "OpenNI2 sensor"; }
  std::optional<int> size() const override { return frames_ > 0 ? std::optional(frames_ - delivered_) : std::nullopt; }
  std::optional<std::string> ended_early() const override { return ended_early_; }
  int dropped() const override { return dropped_; }

  /// Each depth image waits for the color image closest in time, before or shortly after it.
  std::optional<Frame> next() override {
    while (!is_ready()) at_end_ = !read_image();
    if (queue_.empty()) return std::nullopt;
    Frame frame = std::move(queue_.front());
    queue_.pop_front();
    attach_color(frame);
    frame.index = delivered_++;
    return frame;
  }

 private:
  /// Waits for an image and stores it. Returns false at the end of the stream.
  bool read_image() {
    if (frames_ > 0 && read_ == frames_) return false;
    openni::VideoStream* streams[] = {&depth_, &color_};
    int ready = -1;
    const auto status = openni::OpenNI::waitForAnyStream(streams, has_color_ ? 2 : 1, &ready, kTimeout);
    if (unplugged_->happened() || status != openni::STATUS_OK) {
      ended_early_ = end_reason();
      return false;
    }
    openni::VideoFrameRef image;
    if (streams[ready]->readFrame(&image) != openni::STATUS_OK) return true;
    if (ready == 0)
      add_depth(image);
    else
      add_color(image);
    return true;
  }

  [[noreturn]] void fail(openni::Status status) const {
    const std::string reason = openni::OpenNI::getExtendedError();
    const bool is_file = extension_of(name_) == ".oni";
    if (is_file && !fs::exists(name_)) throw std::runtime_error(name_ + ": there is no such file");
    if (is_file) throw std::runtime_error(name_ + ": is cut off or not a readable OpenNI recording");
    if (name_ == "openni:" || status == openni::STATUS_NO_DEVICE)
      throw std::runtime_error("openni: " + no_sensor_message());
    throw std::runtime_error("openni:" + name_ + ": cannot be opened; is another program using it? " + reason);
  }

  /// Empty at the regular end.
  [[nodiscard]] std::optional<std::string> end_reason() const {
    if (unplugged_->happened()) return name_ + ": the sensor was unplugged";
    if (!device_.isFile()) return name_ + ": the sensor sent no image for two seconds";
    if (frames_ > 0) return fmt::format("{}: is cut off after {} of {} images", name_, read_, frames_);
    return std::nullopt;
  }

  void prepare_sensor() {
    choose_mode(depth_, openni::PIXEL_FORMAT_DEPTH_1_MM);
    if (!has_color_) return;
    choose_mode(color_, openni::PIXEL_FORMAT_RGB888);
    (void)depth_.setMirroringEnabled(false);
    (void)color_.setMirroringEnabled(false);
    (void)device_.setDepthColorSyncEnabled(true);
    constexpr auto kRegistered = openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR;
    registered_ = device_.isImageRegistrationModeSupported(kRegistered) &&
                  device_.setImageRegistrationMode(kRegistered) == openni::STATUS_OK;
  }

  void prepare_file(openni::PlaybackControl& playback) {
    (void)playback.setSpeed(-1);  // read on demand
    (void)playback.setRepeatEnabled(false);
    frames_ = playback.getNumberOfFrames(depth_);
    if (frames_ == 0) throw std::runtime_error(name_ + ": has no depth image");
    if (frames_ < 0) spdlog::warn(name_ + ": was never finished; its readable images are used");
  }

  void read_formats() {
    const auto depth = depth_.getVideoMode().getPixelFormat();
    if (depth != openni::PIXEL_FORMAT_DEPTH_1_MM && depth != openni::PIXEL_FORMAT_DEPTH_100_UM)
      throw std::runtime_error(name_ + ": its depth unit is neither 1 mm nor 0.1 mm");
    meters_ = depth == openni::PIXEL_FORMAT_DEPTH_1_MM ? 1e-3f : 1e-4f;
    if (has_color_ && color_.getVideoMode().getPixelFormat() != openni::PIXEL_FORMAT_RGB888) {
      spdlog::warn(name_ + ": its color images are not RGB; color is not used");
      has_color_ = false;
    }
  }

  void use(const CameraFile& file, const fs::path& path) {
    rig_ = file.rig.depth;
    const auto mode = depth_.getVideoMode();
    if (!file.has_size && known_camera(path.string()) == nullptr) {
      rig_.depth.width = mode.getResolutionX(), rig_.depth.height = mode.getResolutionY();
      check(rig_.depth);
    }
    if (rig_.depth.width != mode.getResolutionX() || rig_.depth.height != mode.getResolutionY())
      throw std::runtime_error(fmt::format("{}: is for {}x{} pixels, {} has {}x{}", path.string(), rig_.depth.width,
                                           rig_.depth.height, name_, mode.getResolutionX(), mode.getResolutionY()));
    if (has_color_ && !registered_) rig_.color = file.rig.color;
  }

  void copy_to(const fs::path& file) {
    if (recorder_.create(file.c_str()) != openni::STATUS_OK || recorder_.attach(depth_) != openni::STATUS_OK ||
        (has_color_ && recorder_.attach(color_, true) != openni::STATUS_OK) || recorder_.start() != openni::STATUS_OK)
      throw std::runtime_error("cannot record to " + file.string() + ": " + openni::OpenNI::getExtendedError());
  }

  [[nodiscard]] bool is_ready() const {
    if (at_end_) return true;
    return !queue_.empty() && (!has_color_ || queue_.size() > 1 || color_images_.covers(queue_.front().timestamp));
  }

  void add_depth(const openni::VideoFrameRef& image) {
    ++read_;
    if (last_index_ && image.getFrameIndex() > *last_index_ + 1) dropped_ += image.getFrameIndex() - *last_index_ - 1;
    last_index_ = image.getFrameIndex();
    Frame frame{.timestamp = seconds(image), .world_from_camera = {}, .acceleration = {}};
    if (image.getWidth() != rig_.depth.width || image.getHeight() != rig_.depth.height)
      frame.problem = "the depth image does not have the camera's size";
    else if (!is_complete(image, 2))
      frame.problem = "the depth image is cut off";
    else
      frame.depth = depth_of(image, depth_.getMirroringEnabled(), meters_);
    queue_.push_back(std::move(frame));
  }

  void add_color(const openni::VideoFrameRef& image) {
    if (is_complete(image, 3)) color_images_.add({seconds(image), color_of(image, color_.getMirroringEnabled())});
  }

  void attach_color(Frame& frame) const {
    const ColorImages::Image* image = color_images_.nearest(frame.timestamp);
    if (image == nullptr || frame.problem) return;
    frame.color_delay = image->timestamp - frame.timestamp;
    frame.color = image->pixels;
  }

  std::string name_;
  openni::Device device_;
  openni::VideoStream depth_, color_;
  openni::Recorder recorder_;
  std::optional<Unplugged> unplugged_;
  Rig rig_;
  bool has_color_ = false, registered_ = false, at_end_ = false;
  float meters_ = 1e-3f;  // per depth unit
  int frames_ = 0;        // of a file; -1: unknown
  int read_ = 0, delivered_ = 0;
  std::atomic<int> dropped_ = 0;
  std::optional<int> last_index_;
  std::deque<Frame> queue_;  // for color
  ColorImages color_images_;
  std::optional<std::string> ended_early_;
};

}  // namespace

std::unique_ptr<Source> open_openni(const std::string& uri, const OpenNiOptions& options) {
  return std::make_unique<OpenNiSource>(uri, options);
}

std::vector<SensorInfo> list_openni() {
  start_openni();
  openni::Array<openni::DeviceInfo> devices;
  openni::OpenNI::enumerateDevices(&devices);
  std::vector<SensorInfo> sensors;
  sensors.reserve(static_cast<std::size_t>(devices.getSize()));
  for (int i = 0; i < devices.getSize(); ++i)
    sensors.push_back({std::string("openni:") + devices[i].getUri(),
                       std::string(devices[i].getVendor()) + " " + devices[i].getName()});
  return sensors;
}

}  // namespace cairn
