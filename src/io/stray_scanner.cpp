// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stray Scanner (iPhones and iPads with LiDAR): rgb.mp4 with an image for each line of odometry.csv, depth in
// millimetres and its confidence as images, camera_matrix.csv.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <memory>
#include <set>
#include <stdexcept>

#include "base/image_file.hpp"
#include "base/lines.hpp"
#include "base/read_whole.hpp"
#include "base/words.hpp"
#include "io/recording.hpp"
#include "io/video_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// What stands between the commas of a line. Numbers have no spaces.
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

/// Images of a video by their numbers, which grow from call to call.
class NumberedImages {
 public:
  explicit NumberedImages(const fs::path& file)
      : name_(file.string()), file_(file, VideoFile::Format::mp4), track_(video_track()), decoder_(file_, track_) {}
  [[nodiscard]] int width() const { return file_.tracks()[static_cast<std::size_t>(track_)].width; }
  [[nodiscard]] int height() const { return file_.tracks()[static_cast<std::size_t>(track_)].height; }

  /// Empty: there is none with this number that can be decoded.
  [[nodiscard]] std::vector<std::uint32_t> colour(int number) {
    while (number_ < number && next()) continue;
    if (at_end_ && number_ < number && !told_) {
      told_ = true;
      spdlog::warn("{}: ends after {} images; the frames after that are used by their depth alone", name_, number_ + 1);
    }
    if (number_ != number || !image_) return {};
    if (image_->width() != width() || image_->height() != height()) return {};
    return image_->colour();
  }

 private:
  [[nodiscard]] int video_track() const {
    for (std::size_t i = 0; i < file_.tracks().size(); ++i) {
      const auto& track = file_.tracks()[i];
      if (!track.is_video) continue;
      if (track.codec == "h264" || track.codec == "hevc") return static_cast<int>(i);
      throw std::runtime_error(name_ + ": its video is encoded as " + track.codec +
                               ", expected is H.264 or HEVC; give the file as the app wrote it");
    }
    throw std::runtime_error(name_ + ": has no track of video");
  }

  /// Images come by their times. One that is damaged may not come at all: what went in tells that it was there.
  bool next() {
    for (;;) {
      try {
        if ((image_ = decoder_.next())) {
          const auto its = expected_.find(image_->time());
          number_ += 1 + static_cast<int>(std::distance(expected_.begin(), its));
          expected_.erase(expected_.begin(), its == expected_.end() ? its : std::next(its));
          return true;
        }
        if (at_end_) return false;
        read_on();
      } catch (const std::runtime_error&) {
        // The images after it may be whole.
      }
    }
  }

  void read_on() {
    std::optional<VideoPacket> packet;
    try {
      packet = file_.next();
    } catch (const std::runtime_error&) {
      // Ends here.
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
  std::optional<VideoImage> image_;  // the last that came
  int number_ = -1;                  // its
  std::set<double> expected_;        // times of packets whose images have not come
  bool at_end_ = false, told_ = false;
};

Camera read_camera(const fs::path& file, int width, int height) {
  std::vector<double> m;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    for (const auto& field : fields_of(words)) m.push_back(number_of(field, file, line));
  });
  if (m.size() != 9 || m[8] != 1) throw std::runtime_error(file.string() + ": expected the 3x3 matrix of a camera");
  Camera camera{.width = width, .height = height, .fx = m[0], .fy = m[4], .cx = m[2], .cy = m[5]};
  try {
    check(camera);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
  return camera;
}

/// The same view in images of another size.
Camera scaled(const Camera& camera, int width, int height) {
  const double x = static_cast<double>(width) / camera.width, y = static_cast<double>(height) / camera.height;
  return {.width = width,
          .height = height,
          .fx = camera.fx * x,
          .fy = camera.fy * y,
          .cx = (camera.cx + 0.5) * x - 0.5,
          .cy = (camera.cy + 0.5) * y - 0.5};
}

struct OdometryLine {
  int number;  // of the images in depth/ and confidence/
  StampedPose pose;
};

/// The columns of the header that are needed, and what a line has in them. The app turns ARKit's poses so that the
/// camera looks along +z with y down before it writes them (OdometryEncoder.swift), as ours do.
class OdometryColumns {
 public:
  explicit OdometryColumns(const fs::path& file) : file_(file) {}
  void read_header(const std::vector<std::string>& fields) {
    for (std::size_t i = 0; i < kNames.size(); ++i) {
      const auto it = std::find(fields.begin(), fields.end(), kNames[i]);
      if (it == fields.end())
        throw std::runtime_error(file_.string() + ": its header has no `" + std::string(kNames[i]) +
                                 "`; expected timestamp, frame, x, y, z, qx, qy, qz, qw");
      columns_[i] = static_cast<std::size_t>(it - fields.begin());
    }
  }
  [[nodiscard]] OdometryLine read(int line, const std::vector<std::string>& fields) const {
    std::array<double, kNames.size()> v{};
    for (std::size_t i = 0; i < v.size(); ++i) {
      if (columns_[i] >= fields.size())
        throw std::runtime_error(fmt::format("{}:{}: has fewer columns than the header", file_.string(), line));
      v[i] = number_of(fields[columns_[i]], file_, line);
    }
    if (!(v[1] >= 0 && v[1] < 1e6 && v[1] == std::floor(v[1])))
      throw std::runtime_error(fmt::format("{}:{}: the frame's number is {}", file_.string(), line, v[1]));
    const Eigen::Quaterniond q(v[8], v[5], v[6], v[7]);
    if (!is_rotation(q))
      throw std::runtime_error(fmt::format("{}:{}: the quaternion is zero or too large", file_.string(), line));
    OdometryLine read{.number = static_cast<int>(v[1]), .pose = {.timestamp = v[0]}};
    read.pose.world_from_camera.linear() = q.normalized().toRotationMatrix();
    read.pose.world_from_camera.translation() = Eigen::Vector3d(v[2], v[3], v[4]);
    return read;
  }

 private:
  static constexpr std::array<std::string_view, 9> kNames{"timestamp", "frame", "x", "y", "z", "qx", "qy", "qz", "qw"};
  const fs::path& file_;
  std::array<std::size_t, kNames.size()> columns_{};
};

bool ends_with_a_line(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  in.seekg(-1, std::ios::end);
  return in.get() == '\n';
}

/// `ended_early` is set where the last line was cut off.
std::vector<OdometryLine> read_odometry(const fs::path& file, std::optional<std::string>& ended_early) {
  std::vector<OdometryLine> lines;
  OdometryColumns columns(file);
  bool has_header = false;
  std::optional<std::string> wrong;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (wrong) throw std::runtime_error(*wrong);
    if (!has_header) {
      columns.read_header(fields_of(words));
      has_header = true;
      return;
    }
    try {
      lines.push_back(columns.read(line, fields_of(words)));
    } catch (const std::runtime_error& error) {
      wrong = error.what();
    }
  });
  if (wrong && (lines.empty() || ends_with_a_line(file))) throw std::runtime_error(*wrong);
  if (wrong) ended_early = *wrong + ": the recording is cut off here";
  if (lines.empty()) throw std::runtime_error(file.string() + ": holds no pose");
  return lines;
}

}  // namespace

std::optional<Recording> read_stray_scanner(const fs::path& folder) {
  if (!fs::exists(folder / "rgb.mp4")) return std::nullopt;
  for (const char* name : {"camera_matrix.csv", "odometry.csv", "depth"})
    if (!fs::exists(folder / name))
      throw std::runtime_error(folder.string() +
                               ": a recording of Stray Scanner needs rgb.mp4, camera_matrix.csv, odometry.csv and "
                               "depth, " +
                               name + " is missing");
  Recording recording;
  recording.depth_scale = 1000;
  const auto odometry = read_odometry(folder / "odometry.csv", recording.ended_early);
  std::optional<cv::Size> size;  // of depth
  for (std::size_t i = 0; i < odometry.size(); ++i) {
    const auto name = fmt::format("{:06}.png", odometry[i].number);
    Recording::Entry entry{.timestamp = odometry[i].pose.timestamp, .depth = folder / "depth" / name};
    if (fs::exists(folder / "confidence" / name)) entry.confidence = folder / "confidence" / name;
    if (!size) try {
        size = decode_image(read_whole(entry.depth), cv::IMREAD_UNCHANGED).size();
      } catch (const std::runtime_error&) {
        // Told when the frame is read; another one knows the size.
      }
    recording.entries.push_back(std::move(entry));
    recording.truth.push_back(odometry[i].pose);
  }
  std::stable_sort(recording.truth.begin(), recording.truth.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.timestamp < b.timestamp; });
  if (!size)
    throw std::runtime_error((folder / "depth").string() +
                             ": holds no image NUMBER.png that can be read, of six digits as in odometry.csv");
  const auto video = std::make_shared<NumberedImages>(folder / "rgb.mp4");
  const Camera colour = read_camera(folder / "camera_matrix.csv", video->width(), video->height());
  recording.rig = {scaled(colour, size->width, size->height), ColourCamera{.camera = colour}};
  check(recording.rig);
  recording.colour_of = [video](int i) { return video->colour(i); };
  return recording;
}

}  // namespace cairn
