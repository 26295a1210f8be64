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

#include "cairn/file_name.hpp"
#include "cairn/known_cameras.hpp"
#include "io/camera_file.hpp"
#include "io/oni_file.hpp"
#include "io/openni.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kPatience = 2000;         // milliseconds without an image until a stream counts as ended
constexpr double kHalfAFrame = 0.0175;  // seconds; a more distant color image belongs to another depth image

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

std::string why_no_sensor() {
  return is_plugged_in()
             ? "a depth sensor is plugged in but cannot be opened: allow it with the udev rules of libopenni2-0 "
               "(/lib/udev/rules.d/60-libopenni2-0.rules, then plug it in again), or end the program that uses it"
             : "no depth sensor is plugged in that OpenNI2's drivers know (PrimeSense, Xtion, Kinect for Xbox 360); "
               "look with `lsusb`, or give a recording";
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
    throw std::runtime_error(
        name + ": does not tell its field of view; give its intrinsics with a camera.yaml (SourceOptions::camera)");
  try {
    check(camera);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(name + ": " + error.what() + ", or give them with a camera.yaml (SourceOptions::camera)");
  }
  return camera;
}

double seconds(const openni::VideoFrameRef& image) { return static_cast<double>(image.getTimestamp()) * 1e-6; }

/// True if the data covers the image size: a file may declare any size.
bool is_whole(const openni::VideoFrameRef& image, int bytes_per_pixel) {
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

std::vector<std::uint32_t> colour_of(const openni::VideoFrameRef& image, bool mirrored) {
  return pixels_of<std::uint32_t>(image, mirrored, [](const std::uint8_t* row, int x) {
    const std::uint8_t* p = row + 3 * x;
    return p[0] | std::uint32_t{p[1]} << 8 | std::uint32_t{p[2]} << 16 | 0xff000000u;
  });
}

/// Buffer of the latest color images.
class ColourImages {
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
  [[nodiscard]] bool reach(double timestamp) const {
    return !images_.empty() && images_.back().timestamp >= timestamp - kHalfAFrame;
  }
  /// Returns the image closest in time; null if it belongs to another depth image.
  [[nodiscard]] const Image* nearest(double timestamp) const {
    const Image* nearest = nullptr;
    for (const Image& image : images_)
      if (nearest == nullptr || std::abs(image.timestamp - timestamp) < std::abs(nearest->timestamp - timestamp))
        nearest = &image;
    return nearest != nullptr && std::abs(nearest->timestamp - timestamp) > kHalfAFrame ? nullptr : nearest;
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
    has_colour_ =
        device_.hasSensor(openni::SENSOR_COLOR) && colour_.create(device_, openni::SENSOR_COLOR) == openni::STATUS_OK;
    if (!device_.isFile()) prepare_sensor();
    read_formats();
    if (options.camera.empty())
      rig_ = camera_of(depth_, name_);
    else
      use(camera_named(options.camera), options.camera);
    if (auto* playback = device_.getPlaybackControl()) prepare_file(*playback);
    unplugged_.emplace(device_.getDeviceInfo().getUri());
    if (!options.copy_to.empty()) copy_to(options.copy_to);
    if (depth_.start() != openni::STATUS_OK || (has_colour_ && colour_.start() != openni::STATUS_OK))
      fail(openni::STATUS_ERROR);
  }
  ~OpenNiSource() override {
    recorder_.stop();
    recorder_.destroy();
    depth_.stop();
    colour_.stop();
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
    while (!may_deliver()) at_end_ = !read_image();
    if (waiting_.empty()) return std::nullopt;
    Frame frame = std::move(waiting_.front());
    waiting_.pop_front();
    attach_colour(frame);
    frame.index = delivered_++;
    return frame;
  }

 private:
  /// Waits for an image and stores it. Returns false at the end of the stream.
  bool read_image() {
    if (frames_ > 0 && read_ == frames_) return false;
    openni::VideoStream* streams[] = {&depth_, &colour_};
    int ready = -1;
    const auto status = openni::OpenNI::waitForAnyStream(streams, has_colour_ ? 2 : 1, &ready, kPatience);
    if (unplugged_->happened() || status != openni::STATUS_OK) {
      ended_early_ = why_ended();
      return false;
    }
    openni::VideoFrameRef image;
    if (streams[ready]->readFrame(&image) != openni::STATUS_OK) return true;
    if (ready == 0)
      take_depth(image);
    else
      take_colour(image);
    return true;
  }

  [[noreturn]] void fail(openni::Status status) const {
    const std::string said = openni::OpenNI::getExtendedError();
    const bool is_file = extension_of(name_) == ".oni";
    if (is_file && !fs::exists(name_)) throw std::runtime_error(name_ + ": there is no such file");
    if (is_file) throw std::runtime_error(name_ + ": is cut off or no OpenNI recording");
    if (name_ == "openni:" || status == openni::STATUS_NO_DEVICE)
      throw std::runtime_error("openni: " + why_no_sensor());
    throw std::runtime_error("openni:" + name_ + ": cannot be opened; is another program using it? " + said);
  }

  /// Empty at the regular end.
  [[nodiscard]] std::optional<std::string> why_ended() const {
    if (unplugged_->happened()) return name_ + ": the sensor was unplugged";
    if (!device_.isFile()) return name_ + ": the sensor gave no image for two seconds";
    if (frames_ > 0) return fmt::format("{}: is cut off after {} of {} images", name_, read_, frames_);
    return std::nullopt;
  }

  void prepare_sensor() {
    choose_mode(depth_, openni::PIXEL_FORMAT_DEPTH_1_MM);
    if (!has_colour_) return;
    choose_mode(colour_, openni::PIXEL_FORMAT_RGB888);
    (void)depth_.setMirroringEnabled(false);
    (void)colour_.setMirroringEnabled(false);
    (void)device_.setDepthColorSyncEnabled(true);
    constexpr auto kRegistered = openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR;
    registered_ = device_.isImageRegistrationModeSupported(kRegistered) &&
                  device_.setImageRegistrationMode(kRegistered) == openni::STATUS_OK;
  }

  void prepare_file(openni::PlaybackControl& playback) {
    (void)playback.setSpeed(-1);  // read on demand
    (void)playback.setRepeatEnabled(false);
    frames_ = playback.getNumberOfFrames(depth_);
    if (frames_ == 0) throw std::runtime_error(name_ + ": holds no depth image");
    if (frames_ < 0) spdlog::warn(name_ + ": was never finished; its images are read as far as they go");
  }

  void read_formats() {
    const auto depth = depth_.getVideoMode().getPixelFormat();
    if (depth != openni::PIXEL_FORMAT_DEPTH_1_MM && depth != openni::PIXEL_FORMAT_DEPTH_100_UM)
      throw std::runtime_error(name_ + ": its depth is neither in mm nor in 0.1 mm");
    metres_ = depth == openni::PIXEL_FORMAT_DEPTH_1_MM ? 1e-3f : 1e-4f;
    if (has_colour_ && colour_.getVideoMode().getPixelFormat() != openni::PIXEL_FORMAT_RGB888) {
      spdlog::warn(name_ + ": its colour images are not RGB, they are left out");
      has_colour_ = false;
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
      throw std::runtime_error(fmt::format("{}: is for {}x{} pixels, {} gives {}x{}", path.string(), rig_.depth.width,
                                           rig_.depth.height, name_, mode.getResolutionX(), mode.getResolutionY()));
    if (has_colour_ && !registered_) rig_.colour = file.rig.colour;
  }

  void copy_to(const fs::path& file) {
    if (recorder_.create(file.c_str()) != openni::STATUS_OK || recorder_.attach(depth_) != openni::STATUS_OK ||
        (has_colour_ && recorder_.attach(colour_, true) != openni::STATUS_OK) || recorder_.start() != openni::STATUS_OK)
      throw std::runtime_error("cannot record to " + file.string() + ": " + openni::OpenNI::getExtendedError());
  }

  [[nodiscard]] bool may_deliver() const {
    if (at_end_) return true;
    return !waiting_.empty() &&
           (!has_colour_ || waiting_.size() > 1 || colour_images_.reach(waiting_.front().timestamp));
  }

  void take_depth(const openni::VideoFrameRef& image) {
    ++read_;
    if (last_index_ && image.getFrameIndex() > *last_index_ + 1) dropped_ += image.getFrameIndex() - *last_index_ - 1;
    last_index_ = image.getFrameIndex();
    Frame frame{.timestamp = seconds(image), .world_from_camera = {}, .acceleration = {}};
    if (image.getWidth() != rig_.depth.width || image.getHeight() != rig_.depth.height)
      frame.problem = "the depth image is not of the camera's size";
    else if (!is_whole(image, 2))
      frame.problem = "the depth image is cut off";
    else
      frame.depth = depth_of(image, depth_.getMirroringEnabled(), metres_);
    waiting_.push_back(std::move(frame));
  }

  void take_colour(const openni::VideoFrameRef& image) {
    if (is_whole(image, 3)) colour_images_.add({seconds(image), colour_of(image, colour_.getMirroringEnabled())});
  }

  void attach_colour(Frame& frame) const {
    const ColourImages::Image* image = colour_images_.nearest(frame.timestamp);
    if (image == nullptr || frame.problem) return;
    frame.colour_delay = image->timestamp - frame.timestamp;
    frame.colour = image->pixels;
  }

  std::string name_;
  openni::Device device_;
  openni::VideoStream depth_, colour_;
  openni::Recorder recorder_;
  std::optional<Unplugged> unplugged_;
  Rig rig_;
  bool has_colour_ = false, registered_ = false, at_end_ = false;
  float metres_ = 1e-3f;  // per depth unit
  int frames_ = 0;        // of a file; -1: unknown
  int read_ = 0, delivered_ = 0;
  std::atomic<int> dropped_ = 0;
  std::optional<int> last_index_;
  std::deque<Frame> waiting_;  // for color
  ColourImages colour_images_;
  std::optional<std::string> ended_early_;
};

}  // namespace

std::unique_ptr<Source> open_openni(const std::string& uri, const OpenNiOptions& options) {
  return std::make_unique<OpenNiSource>(uri, options);
}

}  // namespace cairn
