// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Azure Kinect recordings: Matroska with tracks of color, depth and inertial samples, and the factory calibration as an
// attachment.
#include "io/datasets/azure_kinect.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <array>
#include <cmath>
#include <cstring>
#include <deque>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/json_text.hpp"
#include "base/read_json.hpp"
#include "base/words.hpp"
#include "io/inertial_samples.hpp"
#include "io/ros/time_order.hpp"
#include "io/video/video_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
constexpr double kDefaultInterval = 1.0 / 30;  // seconds between depth images, if missing from the file
constexpr std::size_t kMaxQueued = 32;         // queued images; more have equal times, or none
constexpr float kMeters = 1e-3f;               // per depth unit

/// Crop of the depth sensor's image for each mode, at the calibration's resolution or half of it.
struct DepthMode {
  int width, height, sensor, left, top;  // pixels
};
constexpr std::array kDepthModes{DepthMode{320, 288, 512, 96, 90}, DepthMode{640, 576, 1024, 192, 180},
                                 DepthMode{512, 512, 512, 0, 0}, DepthMode{1024, 1024, 1024, 0, 0}};

Eigen::Isometry3d pose_of(const Json& rt) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 9; ++i)
    pose.linear()(i / 3, i % 3) = rt.at("Rotation").at(static_cast<std::size_t>(i)).get<double>();
  for (int i = 0; i < 3; ++i)
    pose.translation()[i] = rt.at("Translation").at(static_cast<std::size_t>(i)).get<double>();
  const Eigen::Matrix3d& rotation = pose.linear();
  if (!(rotation * rotation.transpose()).isIdentity(1e-3) || rotation.determinant() < 0)
    throw std::runtime_error("a `Rotation` is not a rotation");
  pose.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  return pose;
}

/// Camera from normalized intrinsics: fractions of a sensor image of `sensor` pixels, measured from its corner, with
/// `left` and `top` pixels cropped.
Camera camera_of(const Json& intrinsics, Eigen::Vector2d sensor, Eigen::Vector2d left_top, int width, int height) {
  const std::string model = intrinsics.at("ModelType").get<std::string>();
  if (model != "CALIBRATION_LensDistortionModelBrownConrady")
    throw std::runtime_error("the lens has the model '" + shown(model) + "', expected Brown-Conrady");
  std::array<double, 14> p{};  // cx cy fx fy, k1 to k6, center of distortion, p2 p1
  for (std::size_t i = 0; i < p.size(); ++i) p[i] = intrinsics.at("ModelParameters").at(i).get<double>();
  if (std::abs(p[10]) > 1e-6 || std::abs(p[11]) > 1e-6)
    throw std::runtime_error("the lens has a center of distortion off its axis, which is not supported");
  Camera camera{.width = width,
                .height = height,
                .fx = p[2] * sensor.x(),
                .fy = p[3] * sensor.y(),
                .cx = p[0] * sensor.x() - left_top.x() - 0.5,
                .cy = p[1] * sensor.y() - left_top.y() - 0.5,
                .distortion = {p[4], p[5], p[13], p[12], p[6], p[7], p[8], p[9]}};
  check(camera);
  return camera;
}

/// Returns the list entry with `key` equal to `value`.
const Json& entry_of(const Json& list, const char* key, const char* value) {
  for (const Json& entry : list)
    if (entry.at(key) == value) return entry;
  throw std::runtime_error(fmt::format("has no entry with the `{}` {}", key, value));
}

Camera depth_camera_of(const Json& calibration, int width, int height) {
  for (const auto& mode : kDepthModes)
    if (mode.width == width && mode.height == height)
      return camera_of(calibration.at("Intrinsics"), Eigen::Vector2d::Constant(mode.sensor),
                       Eigen::Vector2d(mode.left, mode.top), width, height);
  throw std::runtime_error(fmt::format("depth is {}x{}, which is not a mode of the sensor", width, height));
}

/// Color modes with another aspect ratio than the calibrated image use its full width and the middle of its height.
Camera color_camera_of(const Json& calibration, int width, int height) {
  const double w = calibration.at("SensorWidth").get<double>(), h = calibration.at("SensorHeight").get<double>();
  const Eigen::Vector2d image(width, width * h / w);
  return camera_of(calibration.at("Intrinsics"), image, Eigen::Vector2d(0, (image.y() - height) / 2), width, height);
}

struct Calibration {
  Rig rig;
  std::optional<Eigen::Matrix3d> depth_from_accelerometer;
};

/// `color` may be null.
Calibration calibration_of(const std::string& text, const VideoFile::Track& depth, const VideoFile::Track* color) {
  const Json json = parsed_json_or_none(text);
  if (json.is_discarded()) throw std::runtime_error("is not JSON");
  Calibration read;
  try {
    const Json& all = json.at("CalibrationInformation");
    const Json& depth_entry = entry_of(all.at("Cameras"), "Location", "CALIBRATION_CameraLocationD0");
    read.rig = depth_camera_of(depth_entry, depth.width, depth.height);
    read.rig.sensor = sensor_model("time_of_flight");
    // Each Rt maps points from the rig frame, equal to the depth camera's, to the sensor's own frame.
    const Eigen::Isometry3d rig_from_depth = pose_of(depth_entry.at("Rt")).inverse();
    if (color != nullptr) {
      const Json& entry = entry_of(all.at("Cameras"), "Location", "CALIBRATION_CameraLocationPV0");
      read.rig.color = {color_camera_of(entry, color->width, color->height), pose_of(entry.at("Rt")) * rig_from_depth};
    }
    if (const auto inertial = all.find("InertialSensors"); inertial != all.end() && inertial->is_array())
      for (const Json& sensor : *inertial) {
        const Eigen::Matrix3d depth_from_sensor = (pose_of(sensor.at("Rt")) * rig_from_depth).linear().transpose();
        if (sensor.at("SensorType") == "CALIBRATION_InertialSensorType_Accelerometer")
          read.depth_from_accelerometer = depth_from_sensor;
        if (sensor.at("SensorType") == "CALIBRATION_InertialSensorType_Gyro")
          read.rig.camera_from_imu = Eigen::Quaterniond(depth_from_sensor).normalized();
      }
  } catch (const Json::exception& error) {
    throw std::runtime_error("does not have the format of the sensor: " + plain(error.what()));
  }
  check(read.rig);
  return read;
}

/// Returns the file size in bytes according to its header; empty if the recording was never finished.
std::optional<std::uint64_t> expected_size(const fs::path& file) {
  std::array<std::uint8_t, 4096> begin{};
  std::ifstream(file, std::ios::binary).read(reinterpret_cast<char*>(begin.data()), begin.size());
  std::size_t at = 0;
  // Two EBML elements, a header and the segment with all other data: an ID of four bytes, then a size. Leading zeros of
  // the size's first byte give the number of bytes that follow.
  for (const bool segment : {false, true}) {
    at += 4;
    if (at + 8 > begin.size() || begin[at] == 0) return std::nullopt;
    int more = 0;
    while ((begin[at] & (0x80 >> more)) == 0) ++more;
    std::uint64_t size = begin[at++] & (0x7f >> more);
    std::uint64_t unknown = 0x7f >> more;
    for (int i = 0; i < more; ++i) {
      size = size << 8 | begin[at++];
      unknown = unknown << 8 | 0xff;
    }
    if (size == unknown) return std::nullopt;
    if (segment) return at + size;
    if (size > begin.size()) return std::nullopt;
    at += static_cast<std::size_t>(size);
  }
  return std::nullopt;
}

/// Returns the index of the track with this title (written by older recorders) or this tag; -1 if missing.
int track_with(const VideoFile& file, const char* title, const char* tag) {
  for (std::size_t i = 0; i < file.tracks().size(); ++i) {
    const VideoTags& tags = file.tracks()[i].tags;
    const auto it = tags.find("title");
    if (tags.contains(tag) || (it != tags.end() && it->second == title)) return static_cast<int>(i);
  }
  return -1;
}

class AzureKinectSource final : public Source {
 public:
  explicit AzureKinectSource(const fs::path& path)
      : name_(path.string()), file_(path, VideoFile::Format::matroska), expected_size_(expected_size(path)) {
    find_tracks();
    const auto& depth = file_.tracks()[static_cast<std::size_t>(depth_track_)];
    const auto* color = color_track_ < 0 ? nullptr : &file_.tracks()[static_cast<std::size_t>(color_track_)];
    try {
      const Calibration calibration = calibration_of(calibration_text(), depth, color);
      rig_ = calibration.rig;
      depth_from_accelerometer_ = calibration.depth_from_accelerometer;
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(name_ + ": calibration.json: " + error.what());
    }
    try {
      depth_decoder_.emplace(file_, depth_track_);
      if (color != nullptr) color_decoder_.emplace(file_, color_track_);
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(name_ + ": " + error.what());
    }
    half_interval_ = (depth.interval > 0 ? depth.interval : kDefaultInterval) / 2;
    const auto delay = file_.tags().find("K4A_DEPTH_DELAY_NS");
    if (delay != file_.tags().end()) depth_delay_ = 1e-9 * number_in(delay->second).value_or(0);
    if (!(std::abs(depth_delay_) < 1)) depth_delay_ = 0;
    lookahead_ = std::max(half_interval_ + std::abs(depth_delay_), inertial_track_ < 0 ? 0 : kAccelerationWindow);
  }

  const Rig& rig() const override { return rig_; }
  std::string layout() const override { return "Azure Kinect .mkv file"; }
  std::optional<int> size() const override { return std::nullopt; }
  std::optional<std::string> ended_early() const override { return ended_early_; }

  std::optional<Frame> next() override {
    while (!at_end_ && !is_ready()) read_packet();
    if (depth_.empty()) return std::nullopt;
    const VideoPacket packet = std::move(depth_.front());
    depth_.pop_front();
    const double time = packet.time();
    Frame frame{.index = index_++, .timestamp = time, .world_from_camera = {}, .acceleration = {}};
    try {
      if (!(time > last_timestamp_)) throw std::runtime_error("its timestamp is not after the previous one");
      last_timestamp_ = time;
      frame.depth = depth_in(packet);
    } catch (const std::runtime_error& error) {
      frame.problem = fmt::format("{}: the depth image at byte {}: {}", name_, packet.position(), error.what());
      return frame;
    }
    attach_color(frame);
    samples_.attach_to(frame);
    return frame;
  }

 private:
  void find_tracks() {
    depth_track_ = track_with(file_, "DEPTH", "K4A_DEPTH_TRACK");
    color_track_ = track_with(file_, "COLOR", "K4A_COLOR_TRACK");
    inertial_track_ = track_with(file_, "IMU", "K4A_IMU_TRACK");
    if (depth_track_ < 0)
      throw std::runtime_error(name_ +
                               ": has no depth track; only Matroska files of the Azure Kinect's recorder are "
                               "supported, recorded with a depth mode other than PASSIVE_IR");
    const std::string& depth = file_.tracks()[static_cast<std::size_t>(depth_track_)].codec;
    if (depth != "rawvideo")
      throw std::runtime_error(name_ + ": its depth is encoded as " + depth +
                               ", expected 16-bit gray images (b16g); give the original file of the recorder");
    if (color_track_ < 0) return;
    const std::string& color = file_.tracks()[static_cast<std::size_t>(color_track_)].codec;
    if (color == "mjpeg" || color == "rawvideo") return;
    spdlog::warn("{}: its color is encoded as {}, expected MJPG, NV12, YUY2 or BGRA; color is not used", name_, color);
    color_track_ = -1;
  }

  const std::string& calibration_text() const {
    for (const auto& attachment : file_.attachments()) {
      const auto it = attachment.tags.find("filename");
      if (attachment.tags.contains("K4A_CALIBRATION_FILE") ||
          (it != attachment.tags.end() && it->second == "calibration.json"))
        return attachment.bytes;
    }
    throw std::runtime_error("is not among the attachments; give the original file of the recorder");
  }

  [[nodiscard]] bool is_ready() const {
    return depth_.size() > kMaxQueued ||
           (depth_.size() >= kSortWindow && newest_ >= depth_.front().time() + lookahead_);
  }

  void read_packet() {
    std::optional<VideoPacket> packet;
    try {
      packet = file_.next();
    } catch (const std::runtime_error& error) {
      ended_early_ = error.what();
    }
    if (!packet) {
      at_end_ = true;
      const auto size = fs::file_size(name_);
      if (expected_size_ && *expected_size_ > size)
        ended_early_ = fmt::format("{}: is cut off, it has {} of its {} bytes", name_, size, *expected_size_);
      return;
    }
    newest_ = std::max(newest_, packet->time());
    if (packet->track() == depth_track_) {
      insert_by_time(depth_, *std::move(packet), &VideoPacket::time);
    } else if (packet->track() == color_track_) {
      insert_by_time(color_, *std::move(packet), &VideoPacket::time);
      if (color_.size() > 2 * kMaxQueued) color_.pop_front();
    } else if (packet->track() == inertial_track_) {
      add_inertial(*packet);
    }
  }

  /// Inertial sample, little-endian: accelerometer time (64 bits), x, y, z (floats, m/s^2); then the same for the
  /// gyroscope.
  void add_inertial(const VideoPacket& packet) {
    if (packet.bytes().size() != 40) return;
    const auto vector_at = [&](std::size_t byte) {
      std::array<float, 3> v{};
      std::memcpy(v.data(), packet.bytes().data() + byte, sizeof v);
      return Eigen::Vector3d(v[0], v[1], v[2]);
    };
    const Eigen::Vector3d acceleration = vector_at(8), rate = vector_at(28);
    if (depth_from_accelerometer_ && acceleration.allFinite())
      samples_.add_acceleration({packet.time(), *depth_from_accelerometer_ * acceleration});
    if (rig_.camera_from_imu && rate.allFinite()) samples_.add_rate({packet.time(), rate});
  }

  std::vector<float> depth_in(const VideoPacket& packet) {
    depth_decoder_->put(packet);
    const auto image = depth_decoder_->next();
    if (!image || image->width() != rig_.depth.width || image->height() != rig_.depth.height)
      throw std::runtime_error(fmt::format("does not have {}x{} pixels", rig_.depth.width, rig_.depth.height));
    std::vector<float> depth;
    bool any = false;
    for (const std::uint16_t z : image->gray()) {
      depth.push_back(static_cast<float>(z) * kMeters);
      any |= z > 0;
    }
    if (!any) throw std::runtime_error("holds no measurement");
    return depth;
  }

  /// Attaches the color image closest in time, within half a frame interval.
  void attach_color(Frame& frame) {
    const auto offset = [&](const VideoPacket& p) { return p.time() + depth_delay_ - frame.timestamp; };
    while (!color_.empty() && offset(color_.front()) < -half_interval_) color_.pop_front();
    const VideoPacket* nearest = nullptr;
    for (const VideoPacket& packet : color_)
      if (nearest == nullptr || std::abs(offset(packet)) < std::abs(offset(*nearest))) nearest = &packet;
    if (nearest == nullptr || !(std::abs(offset(*nearest)) <= half_interval_)) return;
    try {
      color_decoder_->put(*nearest);
      const auto image = color_decoder_->next();
      const Camera& camera = rig_.color->camera;
      if (!image || image->width() != camera.width || image->height() != camera.height) return;
      frame.color = image->color();
      frame.color_delay = nearest->time() - frame.timestamp;
    } catch (const std::runtime_error&) {
      // Frames without color are still valid.
    }
  }

  std::string name_;
  VideoFile file_;
  std::optional<std::uint64_t> expected_size_;  // bytes
  Rig rig_;
  std::optional<Eigen::Matrix3d> depth_from_accelerometer_;
  int depth_track_ = -1, color_track_ = -1, inertial_track_ = -1;
  std::optional<VideoDecoder> depth_decoder_, color_decoder_;
  double half_interval_ = kDefaultInterval / 2;
  double depth_delay_ = 0;  // seconds from color to depth, as configured on the sensor
  double lookahead_ = 0;    // seconds read ahead in the file after a depth image before delivery
  double newest_ = -INFINITY, last_timestamp_ = -INFINITY;
  bool at_end_ = false;
  int index_ = 0;
  std::deque<VideoPacket> depth_, color_;  // encoded
  InertialSamples samples_;
  std::optional<std::string> ended_early_;
};

}  // namespace

std::unique_ptr<Source> open_azure_kinect(const fs::path& file) { return std::make_unique<AzureKinectSource>(file); }

}  // namespace cairn
