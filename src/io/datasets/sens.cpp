// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// ScanNet recordings (Dai et al. 2017), version 4: a header with both cameras, then the frames, little-endian. Inertial
// frames, which may follow, are skipped.
#include "io/datasets/sens.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "base/checked_count.hpp"
#include "base/image_file.hpp"
#include "geometry/pose_matrix.hpp"
#include "io/camera_file.hpp"
#include "io/file_bytes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
static_assert(std::endian::native == std::endian::little, "numbers are read in the byte order of the file");
constexpr std::uint32_t kVersion = 4;
constexpr double kFrameRate = 30.0;     // Hz, if no frame has a timestamp
constexpr double kMaxColorDelay = 1.0;  // seconds; larger delays come from different clocks
constexpr std::uint64_t kMaxNameLength = 4096;

enum class ColorKind { raw, png, jpeg };
enum class DepthKind { raw, zlib };
using Matrix = std::array<float, 16>;  // row-major

struct FrameHeader {
  Matrix world_from_camera;
  std::uint64_t color_time, depth_time;  // microseconds
  std::uint64_t color_size, depth_size;  // bytes
};
static_assert(sizeof(FrameHeader) == 96);

struct IndexEntry {
  std::uint64_t position;  // position of the color bytes, followed by the depth bytes
  std::uint64_t color_size, depth_size;
  double timestamp, color_delay = 0;
  std::optional<Eigen::Isometry3d> world_from_camera;
};

struct SensFile {
  Rig rig;
  int color_width = 0, color_height = 0;
  ColorKind color = ColorKind::jpeg;
  DepthKind depth = DepthKind::zlib;
  double depth_scale = 1000;
  std::vector<IndexEntry> frames;
  std::optional<std::string> cut_off;
};

/// Reads the next header field.
template <class T>
T field(FileBytes& in, const char* what) {
  T value;
  if (!in.read(&value, sizeof value))
    throw std::runtime_error(fmt::format("{}: ends at byte {} within `{}` of its header; copy or download it again",
                                         in.name(), in.size(), what));
  return value;
}

Eigen::Isometry3d extrinsic(const Matrix& m, const char* what) {
  std::array<double, 16> numbers{};
  std::copy(m.begin(), m.end(), numbers.begin());
  const auto pose = pose_of_rows(numbers);
  if (!pose)
    throw std::runtime_error(fmt::format("its extrinsic matrix of {} is not a rotation and translation", what));
  return *pose;
}

Camera camera_of(std::uint32_t width, std::uint32_t height, const Matrix& intrinsic) {
  const auto pixels = [](std::uint32_t count) {
    return static_cast<int>(std::min<std::uint32_t>(count, std::numeric_limits<int>::max()));
  };
  Camera c{pixels(width), pixels(height), intrinsic[0], intrinsic[5], intrinsic[2], intrinsic[6], {}};
  check(c);
  return c;
}

void read_header(FileBytes& in, SensFile& file) {
  if (const auto version = field<std::uint32_t>(in, "version"); version != kVersion)
    throw std::runtime_error(
        fmt::format("{}: has version {} at byte 0, only version {} of ScanNet's .sens files is supported", in.name(),
                    version, kVersion));
  const auto length = field<std::uint64_t>(in, "sensor name");
  if (length > std::min(kMaxNameLength, in.left()))
    throw std::runtime_error(fmt::format(
        "{}: has a sensor name of {} bytes at byte 4; it is not a .sens file, or is cut off", in.name(), length));
  in.seek(in.at() + length);
  const auto color_intrinsic = field<Matrix>(in, "intrinsic color");
  const auto color_extrinsic = field<Matrix>(in, "extrinsic color");
  const auto depth_intrinsic = field<Matrix>(in, "intrinsic depth");
  const auto depth_extrinsic = field<Matrix>(in, "extrinsic depth");
  const auto color = field<std::int32_t>(in, "color compression");
  const auto depth = field<std::int32_t>(in, "depth compression");
  const auto sizes = field<std::array<std::uint32_t, 4>>(in, "image sizes");
  file.depth_scale = field<float>(in, "depth shift");
  try {
    if (color < 0 || color > 2)
      throw std::runtime_error(
          fmt::format("its color compression is {}, expected 0 (raw), 1 (PNG) or 2 (JPEG)", color));
    if (depth != 0 && depth != 1)
      throw std::runtime_error(fmt::format("its depth compression is {}, expected 0 (raw) or 1 (zlib){}", depth,
                                           depth == 2 ? "; write it again with zlib, OCCI (2) is not supported" : ""));
    file.color = static_cast<ColorKind>(color);
    file.depth = static_cast<DepthKind>(depth);
    check_depth_scale(file.depth_scale);
    file.rig = camera_of(sizes[2], sizes[3], depth_intrinsic);
    if (sizes[0] == 0 || sizes[1] == 0) return;  // no color
    const ColorCamera color_camera{camera_of(sizes[0], sizes[1], color_intrinsic),
                                   extrinsic(color_extrinsic, "color").inverse() * extrinsic(depth_extrinsic, "depth")};
    if (color_camera != ColorCamera{.camera = file.rig.depth}) file.rig.color = color_camera;
    check(file.rig);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: header before byte {}: {}", in.name(), in.at(), error.what()));
  }
}

/// Sets times in seconds, from each frame's timestamp or, if all are zero, from the rate.
void set_times(std::vector<IndexEntry>& frames, const std::vector<std::array<std::uint64_t, 2>>& microseconds) {
  const bool stamped = std::any_of(microseconds.begin(), microseconds.end(), [](const auto& t) { return t[0] != 0; });
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto [depth, color] = microseconds[i];
    frames[i].timestamp = stamped ? 1e-6 * static_cast<double>(depth) : static_cast<double>(i) / kFrameRate;
    if (!stamped || color == 0) continue;
    const double delay = 1e-6 * (static_cast<double>(color) - static_cast<double>(depth));
    if (std::abs(delay) <= kMaxColorDelay) frames[i].color_delay = delay;
  }
}

SensFile index_sens(const fs::path& path) {
  FileBytes in(path);
  SensFile file;
  read_header(in, file);
  const auto count = field<std::uint64_t>(in, "number of frames");
  std::vector<std::array<std::uint64_t, 2>> times;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t begin = in.at();
    FrameHeader head;
    const bool is_complete =
        in.read(&head, sizeof head) && head.color_size <= in.left() && head.depth_size <= in.left() - head.color_size;
    if (!is_complete) {
      file.cut_off = fmt::format("{}: is cut off in frame {} of {}, which begins at byte {}; copy or download it again",
                                 in.name(), i, count, begin);
      break;
    }
    std::array<double, 16> pose{};
    std::copy(head.world_from_camera.begin(), head.world_from_camera.end(), pose.begin());
    file.frames.push_back({.position = in.at(),
                           .color_size = head.color_size,
                           .depth_size = head.depth_size,
                           .timestamp = 0,
                           .world_from_camera = pose_of_rows(pose)});
    times.push_back({head.depth_time, head.color_time});
    in.seek(in.at() + head.color_size + head.depth_size);
  }
  if (file.frames.empty())
    throw std::runtime_error(file.cut_off.value_or(in.name() + ": has no frame; copy or download it again"));
  set_times(file.frames, times);
  std::stable_sort(file.frames.begin(), file.frames.end(),
                   [](const IndexEntry& a, const IndexEntry& b) { return a.timestamp < b.timestamp; });
  return file;
}

class SensSource final : public Source {
 public:
  SensSource(const fs::path& path, const FrameRange& range, bool depth_only)
      : file_(index_sens(path)), in_(path), range_(range), depth_only_(depth_only), next_(range.begin) {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // errors go into Frame::problem
    end_ = static_cast<int>(file_.frames.size());
    if (range.end) end_ = std::min(end_, *range.end);
  }

  const Rig& rig() const override { return file_.rig; }
  std::string layout() const override { return "ScanNet .sens file"; }
  std::optional<int> size() const override { return std::max(0, (end_ - next_ + range_.step - 1) / range_.step); }
  std::optional<double> next_timestamp() const override {
    if (next_ >= end_) return std::nullopt;
    return file_.frames[static_cast<std::size_t>(next_)].timestamp;
  }
  void skip() override { next_ += range_.step; }
  std::optional<std::string> ended_early() const override {
    const bool is_truncated = next_ >= end_ && end_ == static_cast<int>(file_.frames.size());
    return is_truncated ? file_.cut_off : std::nullopt;
  }

  std::optional<Frame> next() override {
    if (next_ >= end_) return std::nullopt;
    const IndexEntry& entry = file_.frames[static_cast<std::size_t>(next_)];
    Frame frame{.index = next_, .timestamp = entry.timestamp, .color_delay = entry.color_delay};
    next_ += range_.step;
    try {
      if (entry.timestamp <= last_timestamp_) throw std::runtime_error("its timestamp is not after the previous one");
      last_timestamp_ = entry.timestamp;
      frame.depth = read_depth(entry);
    } catch (const std::exception& error) {
      frame.problem = fmt::format("{}: frame {}, byte {}: {}", in_.name(), frame.index, entry.position, error.what());
      return frame;
    }
    if (depth_only_) return frame;
    try {
      frame.color = read_color(entry);
    } catch (const std::exception&) {
      // Frames without color are still valid.
    }
    return frame;
  }

 private:
  std::vector<std::uint8_t> read_bytes(std::uint64_t position, std::uint64_t count) {
    std::vector<std::uint8_t> bytes(count);
    in_.seek(position);
    if (!in_.read(bytes.data(), count))
      throw std::runtime_error("cannot be read: the file has changed, or the disk is failing");
    return bytes;
  }

  std::vector<float> read_depth(const IndexEntry& entry) {
    const std::size_t count = product(file_.rig.depth.width, file_.rig.depth.height);
    // Upper bound for raw data, and for zlib data with its overhead.
    if (entry.depth_size > 4 * count + 1024)
      throw std::runtime_error(fmt::format("depth has {} bytes, more than its size allows", entry.depth_size));
    const auto bytes = read_bytes(entry.position + entry.color_size, entry.depth_size);
    std::vector<std::uint16_t> units(count);
    auto unpacked = static_cast<uLongf>(2 * count);
    if (file_.depth == DepthKind::raw) {
      if (bytes.size() != 2 * count)
        throw std::runtime_error(fmt::format("depth has {} bytes, its size needs {}", bytes.size(), 2 * count));
      std::memcpy(units.data(), bytes.data(), bytes.size());
    } else if (uncompress(reinterpret_cast<Bytef*>(units.data()), &unpacked, bytes.data(), bytes.size()) != Z_OK ||
               unpacked != 2 * count) {
      throw std::runtime_error("depth is not zlib data of its size");
    }
    std::vector<float> depth(count);
    const float meters = static_cast<float>(1.0 / file_.depth_scale);
    std::transform(units.begin(), units.end(), depth.begin(),
                   [&](std::uint16_t value) { return static_cast<float>(value) * meters; });
    if (std::all_of(units.begin(), units.end(), [](std::uint16_t value) { return value == 0; }))
      throw std::runtime_error("depth holds no measurement");
    return depth;
  }

  std::vector<std::uint32_t> read_color(const IndexEntry& entry) {
    const Camera& c = file_.rig.color_view();
    const std::uint64_t raw = product(3, c.width, c.height);
    if (entry.color_size == 0 || entry.color_size > 2 * raw + (1 << 20)) return {};
    auto bytes = read_bytes(entry.position, entry.color_size);
    cv::Mat rgba;
    if (file_.color == ColorKind::raw) {
      if (bytes.size() != raw) return {};
      cv::cvtColor(cv::Mat(c.height, c.width, CV_8UC3, bytes.data()), rgba, cv::COLOR_RGB2RGBA);
    } else {
      rgba = decode_image(bytes, Pixels::rgba, {.size = {c.width, c.height}, .camera = "color camera"});
    }
    return color_pixels(rgba);
  }

  SensFile file_;
  FileBytes in_;
  FrameRange range_;
  bool depth_only_;
  int next_ = 0, end_ = 0;
  double last_timestamp_ = -INFINITY;
};

}  // namespace

std::unique_ptr<Source> open_sens(const fs::path& file, const FrameRange& range, bool depth_only) {
  return std::make_unique<SensSource>(file, range, depth_only);
}

Trajectory sens_truth(const fs::path& file) {
  Trajectory truth;
  for (const IndexEntry& frame : index_sens(file).frames)
    if (frame.world_from_camera && (truth.empty() || frame.timestamp > truth.back().timestamp))
      truth.push_back({frame.timestamp, *frame.world_from_camera});
  return truth;
}

}  // namespace cairn
