// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stray Scanner (iPhones and iPads with LiDAR): rgb.mp4 with an image for each line of odometry.csv, depth in
// millimeters and confidence as images, and camera_matrix.csv.
#include "io/datasets/stray_scanner.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <memory>
#include <set>
#include <stdexcept>

#include "base/image_file.hpp"
#include "base/lines.hpp"
#include "base/median.hpp"
#include "base/read_whole.hpp"
#include "base/words.hpp"
#include "io/recording.hpp"
#include "io/video/video_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Splits a line at commas. Numbers contain no spaces.
std::vector<std::string> fields_of(const std::vector<std::string>& words) {
  std::vector<std::string> fields(1);
  for (const auto& word : words)
    for (const char c : word)
      if (c == ',')
        fields.emplace_back();
      else
        fields.back() += c;
  return fields;
}

/// Video images by number; numbers must increase from call to call.
class NumberedImages {
 public:
  explicit NumberedImages(const fs::path& file)
      : name_(file.string()), file_(file, VideoFile::Format::mp4), track_(video_track()), decoder_(file_, track_) {}
  [[nodiscard]] int width() const { return file_.tracks()[static_cast<std::size_t>(track_)].width; }
  [[nodiscard]] int height() const { return file_.tracks()[static_cast<std::size_t>(track_)].height; }

  /// Returns the image with this number; empty if it cannot be decoded.
  [[nodiscard]] std::vector<std::uint32_t> color(int number) {
    while (number_ < number && next()) continue;
    if (at_end_ && number_ < number && !has_warned_) {
      has_warned_ = true;
      spdlog::warn("{}: ends after {} images; later frames have depth only", name_, number_ + 1);
    }
    if (number_ != number || !image_) return {};
    if (image_->width() != width() || image_->height() != height()) return {};
    return image_->color();
  }

 private:
  [[nodiscard]] int video_track() const {
    for (std::size_t i = 0; i < file_.tracks().size(); ++i) {
      const auto& track = file_.tracks()[i];
      if (!track.is_video) continue;
      if (track.codec == "h264" || track.codec == "hevc") return static_cast<int>(i);
      throw std::runtime_error(name_ + ": its video is encoded as " + track.codec +
                               ", expected H.264 or HEVC; give the original file of the app");
    }
    throw std::runtime_error(name_ + ": has no video track");
  }

  /// Advances to the next decoded image, in time order. Damaged images may be missing from the output, so packet times
  /// give the number.
  bool next() {
    for (;;) {
      try {
        if ((image_ = decoder_.next())) {
          const auto expected = expected_.find(image_->time());
          number_ += 1 + static_cast<int>(std::distance(expected_.begin(), expected));
          expected_.erase(expected_.begin(), expected == expected_.end() ? expected : std::next(expected));
          return true;
        }
        if (at_end_) return false;
        read_packet();
      } catch (const std::runtime_error&) {
        // Later images may be intact.
      }
    }
  }

  void read_packet() {
    std::optional<VideoPacket> packet;
    try {
      packet = file_.next();
    } catch (const std::runtime_error&) {
      // End of the readable part.
    }
    if (!packet) {
      at_end_ = true;
      decoder_.end();
    } else if (packet->track() == track_) {
      expected_.insert(packet->time());
      decoder_.put(*packet);
    }
  }

  std::string name_;
  VideoFile file_;
  int track_;
  VideoDecoder decoder_;
  std::optional<VideoImage> image_;  // last decoded image
  int number_ = -1;                  // its number
  std::set<double> expected_;        // times of packets without a decoded image so far
  bool at_end_ = false, has_warned_ = false;
};

/// Reads camera_matrix.csv, which has no image size.
Camera read_matrix(const fs::path& file) {
  std::vector<double> m;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    for (const auto& field : fields_of(words)) m.push_back(number_of(field, file, line));
  });
  if (m.size() != 9 || m[8] != 1) throw std::runtime_error(file.string() + ": expected the 3x3 matrix of a camera");
  return {.fx = m[0], .fy = m[4], .cx = m[2], .cy = m[5]};
}

Camera read_camera(const fs::path& file, int width, int height) {
  Camera camera = read_matrix(file);
  camera.width = width, camera.height = height;
  try {
    check(camera);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
  return camera;
}

/// Required columns of a header, and their values in a line.
class Columns {
 public:
  Columns(fs::path file, std::vector<std::string_view> names) : file_(std::move(file)), names_(std::move(names)) {}
  void read_header(const std::vector<std::string>& fields) {
    for (const std::string_view name : names_) {
      const auto it = std::find(fields.begin(), fields.end(), name);
      if (it == fields.end())
        throw std::runtime_error(
            fmt::format("{}: its header has no `{}`; expected {}", file_.string(), name, fmt::join(names_, ", ")));
      columns_.push_back(static_cast<std::size_t>(it - fields.begin()));
    }
  }
  [[nodiscard]] std::vector<double> read(int line, const std::vector<std::string>& fields) const {
    std::vector<double> values;
    for (const std::size_t column : columns_) {
      if (column >= fields.size())
        throw std::runtime_error(fmt::format("{}:{}: has fewer columns than the header", file_.string(), line));
      values.push_back(number_of(fields[column], file_, line));
    }
    return values;
  }

 private:
  fs::path file_;
  std::vector<std::string_view> names_;
  std::vector<std::size_t> columns_;
};

/// Calls `take(line number, values)` for each line of a file with a header, up to the first invalid line; returns the
/// error.
std::optional<std::string> for_each_line_of(const fs::path& file, const std::vector<std::string_view>& names,
                                            const std::function<void(int, const std::vector<double>&)>& take) {
  Columns columns(file, names);
  bool has_header = false;
  std::optional<std::string> error_text;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (error_text) throw std::runtime_error(*error_text);
    if (!has_header) {
      columns.read_header(fields_of(words));
      has_header = true;
      return;
    }
    try {
      take(line, columns.read(line, fields_of(words)));
    } catch (const std::runtime_error& error) {
      error_text = error.what();
    }
  });
  return error_text;
}

struct OdometryLine {
  int number;  // of the images in depth/ and confidence/
  StampedPose pose;
};

/// Reads a line of odometry.csv. The app rotates ARKit's poses before writing, so that the camera looks along +z with y
/// down (OdometryEncoder.swift), the same as Cairn's.
OdometryLine odometry_of(const std::vector<double>& v, const fs::path& file, int line) {
  if (!(v[1] >= 0 && v[1] < 1e6 && v[1] == std::floor(v[1])))
    throw std::runtime_error(fmt::format("{}:{}: the frame number is {}", file.string(), line, v[1]));
  const Eigen::Quaterniond q(v[8], v[5], v[6], v[7]);
  if (!is_rotation(q))
    throw std::runtime_error(fmt::format("{}:{}: the quaternion is zero or too large", file.string(), line));
  OdometryLine read{.number = static_cast<int>(v[1]), .pose = {.timestamp = v[0]}};
  read.pose.world_from_camera.linear() = q.normalized().toRotationMatrix();
  read.pose.world_from_camera.translation() = Eigen::Vector3d(v[2], v[3], v[4]);
  return read;
}

bool ends_with_a_line(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  in.seekg(-1, std::ios::end);
  return in.get() == '\n';
}

/// Reads odometry.csv, sorted by time. `ended_early` is set if the last line is truncated.
std::vector<OdometryLine> read_odometry(const fs::path& file, std::optional<std::string>& ended_early) {
  std::vector<OdometryLine> lines;
  const auto error_text = for_each_line_of(
      file, {"timestamp", "frame", "x", "y", "z", "qx", "qy", "qz", "qw"},
      [&](int line, const std::vector<double>& values) { lines.push_back(odometry_of(values, file, line)); });
  if (error_text && (lines.empty() || ends_with_a_line(file))) throw std::runtime_error(*error_text);
  if (error_text) ended_early = *error_text + ": the recording is cut off here";
  if (lines.empty()) throw std::runtime_error(file.string() + ": holds no pose");
  // Video images are in time order.
  std::stable_sort(lines.begin(), lines.end(),
                   [](const OdometryLine& a, const OdometryLine& b) { return a.pose.timestamp < b.pose.timestamp; });
  return lines;
}

/// Reads the gyroscope; errors in the file only disable the gyroscope.
std::vector<AngularRate> read_gyroscope(const fs::path& file, double begin, double end) {
  std::vector<AngularRate> samples;
  std::optional<std::string> error_text;
  try {
    error_text =
        for_each_line_of(file, {"timestamp", "alpha_x", "alpha_y", "alpha_z"}, [&](int, const std::vector<double>& v) {
          samples.push_back({v[0], {v[1], v[2], v[3]}});
        });
  } catch (const std::runtime_error& error) {
    error_text = error.what();
  }
  if (!error_text && samples.empty()) error_text = file.string() + ": holds no sample";
  if (error_text)
    spdlog::warn("{}; the gyroscope is {}", *error_text, samples.empty() ? "not used" : "used up to this line");
  std::stable_sort(samples.begin(), samples.end(),
                   [](const AngularRate& a, const AngularRate& b) { return a.timestamp < b.timestamp; });
  const bool is_disjoint = !samples.empty() && (samples.back().timestamp < begin || samples.front().timestamp > end);
  if (!is_disjoint) return samples;
  spdlog::warn("{}: its times do not overlap with those of odometry.csv; the gyroscope is not used", file.string());
  return {};
}

/// Reads the accelerometer of a file that has its columns, in axes of the camera. Core Motion's sign is the opposite of
/// the specific force; some versions of the app write units of g.
std::vector<Acceleration> read_accelerometer(const fs::path& file, double begin, double end) {
  constexpr double kGravity = 9.80665, kMaxNormInG = 3;  // m/s^2; median norm
  std::vector<Acceleration> samples;
  try {
    (void)for_each_line_of(file, {"timestamp", "a_x", "a_y", "a_z"}, [&](int, const std::vector<double>& v) {
      samples.push_back({v[0], -(camera_from_phone() * Eigen::Vector3d(v[1], v[2], v[3]))});
    });
  } catch (const std::runtime_error&) {
    return {};  // the gyroscope alone, with its own messages
  }
  if (samples.empty()) return samples;
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Acceleration& a, const Acceleration& b) { return a.timestamp < b.timestamp; });
  if (samples.back().timestamp < begin || samples.front().timestamp > end) return {};
  std::vector<double> norms;
  norms.reserve(samples.size());
  for (const Acceleration& sample : samples) norms.push_back(sample.value.norm());
  if (median(norms) < kMaxNormInG)
    for (Acceleration& sample : samples) sample.value *= kGravity;
  return samples;
}

/// True if the gyroscope, rotated by `camera_from_imu`, matches the rotation of the poses, and the rotation is large
/// enough to exclude other axes.
bool fits(const std::vector<AngularRate>& gyro, const Trajectory& poses, const Eigen::Quaterniond& camera_from_imu) {
  constexpr double kMinRate = 0.05;       // rad/s, root mean square
  constexpr double kMaxDifference = 0.5;  // maximum difference as a share of the rate; 1 or more for wrong axes
  double rate_energy = 0, error_energy = 0, count = 0;
  auto sample = gyro.begin();
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const double step = poses[i].timestamp - poses[i - 1].timestamp;
    while (sample != gyro.end() && sample->timestamp <= poses[i - 1].timestamp) ++sample;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int samples = 0;
    for (; sample != gyro.end() && sample->timestamp <= poses[i].timestamp; ++sample, ++samples) sum += sample->rate;
    if (samples == 0 || !(step > 0)) continue;
    const Eigen::AngleAxisd turn(poses[i - 1].world_from_camera.linear().transpose() *
                                 poses[i].world_from_camera.linear());
    const Eigen::Vector3d rate = turn.angle() / step * turn.axis();
    rate_energy += rate.squaredNorm();
    error_energy += (rate - camera_from_imu * (sum / samples)).squaredNorm();
    ++count;
  }
  return rate_energy > count * kMinRate * kMinRate && error_energy < kMaxDifference * kMaxDifference * rate_energy;
}

/// Adds the images of each line of odometry.csv and returns their size.
cv::Size read_images(const fs::path& folder, Recording& recording) {
  const auto odometry = read_odometry(folder / "odometry.csv", recording.ended_early);
  std::optional<cv::Size> size;
  for (const OdometryLine& line : odometry) {
    const auto name = fmt::format("{:06}.png", line.number);
    Recording::Entry entry{.timestamp = line.pose.timestamp, .depth = folder / "depth" / name};
    if (fs::exists(folder / "confidence" / name)) entry.confidence = folder / "confidence" / name;
    if (!size) try {
        size = decode_image(read_whole(entry.depth), Pixels::as_stored).size();
      } catch (const std::runtime_error&) {
        // Reported when the frame is read; another image defines the size.
      }
    recording.entries.push_back(std::move(entry));
    recording.truth.push_back(line.pose);
  }
  if (!size)
    throw std::runtime_error((folder / "depth").string() +
                             ": has no readable image NUMBER.png, with a six-digit number as in odometry.csv");
  return *size;
}

/// Size of the missing video described by camera_matrix.csv: the ARKit size of depth's aspect ratio with the principal
/// point near its middle. Throws if no size fits.
cv::Size size_of_video(const fs::path& file, const Camera& camera, const cv::Size& depth) {
  const cv::Size kSizes[] = {{1920, 1440}, {1280, 960},  {1024, 768},  {960, 720},   {640, 480},
                             {4032, 3024}, {3840, 2880}, {3840, 2160}, {1920, 1080}, {1280, 720}};
  constexpr double kMaxOffset = 0.05;  // share of the size; maximum offset of Apple's principal points from the middle
  const auto offset = [&](const cv::Size& size) {
    return std::max(std::abs(camera.cx / size.width - 0.5), std::abs(camera.cy / size.height - 0.5));
  };
  const auto has_aspect = [&](const cv::Size& size) {
    return std::abs(static_cast<double>(size.width) * depth.height / (static_cast<double>(size.height) * depth.width) -
                    1) <= kMaxAspectError;
  };
  cv::Size best = depth;
  for (const cv::Size& size : kSizes)
    if (has_aspect(size) && offset(size) < offset(best)) best = size;
  if (offset(best) > kMaxOffset)
    throw std::runtime_error(
        fmt::format("{}: its principal point, {} {}, fits no video size of ARKit, and rgb.mp4 is missing: give the "
                    "camera in camera.yaml, with its width and height",
                    file.string(), camera.cx, camera.cy));
  return best;
}

/// Sets the cameras. `video`: size of its images, zero if missing.
void set_cameras(const fs::path& folder, const cv::Size& depth, cv::Size video, Recording& recording) {
  const fs::path file = folder / "camera_matrix.csv";
  if (!fs::exists(file)) {
    recording.camera_is_missing = true;
    recording.camera_hint = "camera_matrix.csv is missing; restore it, or ";
    recording.rig.depth = scaled_to(Camera{}, {depth.width, depth.height});
    if (video.width > 0) recording.rig.color = ColorCamera{.camera = scaled_to(Camera{}, {video.width, video.height})};
    return;
  }
  const bool has_video = video.width > 0;
  if (!has_video) video = size_of_video(file, read_matrix(file), depth);
  const Camera color = read_camera(file, video.width, video.height);
  recording.rig = scaled_to(color, {depth.width, depth.height});
  if (has_video)
    recording.rig.color = ColorCamera{.camera = color};
  else
    recording.interpretations.push_back({"camera of", fmt::format("{}, for a video of {}x{} by its principal point",
                                                                  file.string(), video.width, video.height)});
}

}  // namespace

std::optional<Recording> read_stray_scanner(const fs::path& folder) {
  const bool has_video = fs::exists(folder / "rgb.mp4");
  // Other programs use the name odometry.csv too.
  if (!has_video && !(fs::exists(folder / "odometry.csv") && fs::is_directory(folder / "depth") &&
                      (fs::exists(folder / "camera_matrix.csv") || fs::is_directory(folder / "confidence"))))
    return std::nullopt;
  for (const char* name : {"odometry.csv", "depth"})
    if (!fs::exists(folder / name))
      throw std::runtime_error(folder.string() +
                               ": a recording of Stray Scanner needs camera_matrix.csv, odometry.csv and depth, " +
                               name + " is missing");
  Recording recording;
  recording.layout = "Stray Scanner folder";
  recording.has_device_poses = true;
  recording.depth_scale = 1000;
  recording.max_confidence = 2;
  const cv::Size size = read_images(folder, recording);
  const auto video = has_video ? std::make_shared<NumberedImages>(folder / "rgb.mp4") : nullptr;
  set_cameras(folder, size, video ? cv::Size(video->width(), video->height()) : cv::Size(), recording);
  recording.rig.sensor = sensor_model("phone_lidar");
  check(recording.rig);
  if (const auto imu = folder / "imu.csv"; fs::exists(imu) && !recording.truth.empty()) {
    recording.gyro = read_gyroscope(imu, recording.truth.front().timestamp, recording.truth.back().timestamp);
    if (fits(recording.gyro, recording.truth, camera_from_phone())) recording.rig.camera_from_imu = camera_from_phone();
    if (!recording.gyro.empty())
      recording.accelerations =
          read_accelerometer(imu, recording.truth.front().timestamp, recording.truth.back().timestamp);
  }
  if (video) recording.color_of = [video](int i) { return video->color(i); };
  return recording;
}

}  // namespace cairn
