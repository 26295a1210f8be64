// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "base/depth_image.hpp"
#include "base/file_name.hpp"
#include "base/image_file.hpp"
#include "base/path_kind.hpp"
#include "base/read_whole.hpp"
#include "cairn/io/find_color_camera.hpp"
#include "cairn/io/known_cameras.hpp"
#include "cairn/io/layouts.hpp"
#include "cairn/io/source.hpp"
#include "io/datasets/image_names.hpp"
#include "io/datasets/sens.hpp"
#include "io/datasets/zip_recording.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"
#include "io/recording_segment.hpp"
#include "io/resample.hpp"
#include "synth/source.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr float kMaxDepth = 1000;  // meters; larger values in float images mean "no measurement"
/// Maximum pixel difference between a frame's own camera and the recording's without resampling: 0.6 mm at 3 m and 525
/// pixels, below the resolution of depth cameras. Resampling smooths depth and takes time.
constexpr double kMaxShift = 0.1;

/// Returns a subfolder that holds depth images or a list of them.
std::optional<fs::path> recording_subfolder(const fs::path& folder) {
  std::error_code ignored;
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (entry.is_directory(ignored) &&
        (fs::exists(entry.path() / "depth.txt", ignored) || fs::is_directory(entry.path() / "depth", ignored)))
      found.push_back(entry.path());
  const auto first = std::min_element(found.begin(), found.end());
  return first == found.end() ? std::nullopt : std::optional(*first);
}

/// Sorts frames and poses by time.
void sort_by_time(Recording& recording) {
  const auto earlier = [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; };
  std::stable_sort(recording.truth.begin(), recording.truth.end(), earlier);
  if (std::is_sorted(recording.entries.begin(), recording.entries.end(), earlier)) return;
  std::stable_sort(recording.entries.begin(), recording.entries.end(), earlier);
  recording.notes.push_back("its images are not listed in time order: they are sorted by time");
}

Recording read_recording(const fs::path& folder) {
  if (!fs::exists(folder)) throw std::runtime_error(folder.string() + ": there is no such folder");
  if (!fs::is_directory(folder))
    throw std::runtime_error(kind_of_path(folder).mismatch(folder, "recording") +
                             "; give the folder that holds the recording");
  for (const auto read : {read_tum, read_associations, read_seven_scenes, read_stray_scanner, read_intrinsics_folder,
                          read_nerfstudio, read_record3d, read_polycam, read_rtabmap, read_replica, read_image_folder})
    if (auto recording = read(folder)) {
      sort_by_time(*recording);
      return *std::move(recording);
    }
  using Kind = PathKind::Kind;
  const PathKind kind = kind_of_path(folder);
  if (kind.kind != Kind::recording && !kind.remedy.empty())
    throw std::runtime_error(kind.mismatch(folder, "recording"));
  if (const auto subfolder = recording_subfolder(folder))
    throw std::runtime_error(
        fmt::format("{}: is not a known recording, but its subfolder {} looks like one: give that folder",
                    folder.string(), subfolder->filename().string()));
  if (const std::size_t images = images_in(folder).size(); images > 0)
    throw std::runtime_error(
        fmt::format("{}: is not a known recording: it has {} images, none of them depth; expected depth images in "
                    "depth, depths or depth_raw, or with `depth` in their names",
                    folder.string(), images));
  throw std::runtime_error(folder.string() + ": is not a known recording, it " + kind.words +
                           "; expected depth images in depth and color images in rgb, color or "
                           "images, with camera.yaml or intrinsics.json (your own), rgb.txt and depth.txt "
                           "(TUM), frame-000000.depth.png (7-Scenes), associations.txt (ORB-SLAM, ICL-NUIM), "
                           "odometry.csv (Stray Scanner), transforms.json (nerfstudio), metadata.json (Record3D), "
                           "keyframes (Polycam), intrinsic.json or camera_intrinsic.json (Open3D), "
                           "calib or calibration.yaml (RTAB-Map), results and traj.txt (Replica), or metadata.yaml "
                           "(rosbag2)");
}

/// Reads the folder's files, with the camera, unit and rate decided by resolve_camera().
Recording read_with_camera(const fs::path& folder, const fs::path& camera) {
  Recording recording = read_recording(folder);
  resolve_camera(folder, camera, recording);
  if (!recording.is_plain) return recording;
  try {
    add_motion(folder, recording);
  } catch (const std::runtime_error& error) {  // file of another program's format
    recording.warnings.push_back(fmt::format("{}; the file is not used", error.what()));
  }
  return recording;
}

/// Adds the properties found in sample images but missing from the files.
Recording analyze_recording(const fs::path& folder, const fs::path& camera) {
  Recording recording = read_with_camera(folder, camera);
  infer_depth_format(recording);
  if (const PathKind kind = kind_of_path(folder);
      recording.camera_is_missing && kind.kind == PathKind::Kind::images_of_recording)
    throw std::runtime_error(kind.mismatch(folder, "recording of its own"));
  if (recording.camera_is_missing)
    throw std::runtime_error(fmt::format("{}: the camera is unknown: {}{}{}", folder.string(), recording.camera_hint,
                                         unused_cameras_in(folder),
                                         how_to_give_the_camera(folder, recording.rig.depth)));
  const bool has_color = recording.color_of || std::any_of(recording.entries.begin(), recording.entries.end(),
                                                           [](const auto& entry) { return !entry.color.empty(); });
  if (!has_color) recording.notes.push_back("there is no color: only depth is used");
  return recording;
}

struct SizedImage {
  fs::path file;
  Eigen::Vector2i size;
};
/// First image with the most common size among some color images; empty if none is readable.
std::optional<SizedImage> common_color(const std::vector<Recording::Entry>& entries) {
  constexpr std::size_t kMaxSamples = 5;
  std::vector<const fs::path*> files;
  for (const auto& entry : entries)
    if (!entry.color.empty()) files.push_back(&entry.color);
  std::vector<std::pair<SizedImage, int>> sizes;
  for (std::size_t k = 0, read = 0; k < files.size() && read < kMaxSamples; ++k) {
    // Evenly spread if readable, else one after another.
    const std::size_t at =
        files.size() > kMaxSamples && k < kMaxSamples ? (files.size() - 1) * k / (kMaxSamples - 1) : k;
    const auto size = size_of_image(*files[at]);
    if (!size) continue;
    ++read;
    const auto it = std::find_if(sizes.begin(), sizes.end(), [&](const auto& s) { return s.first.size == *size; });
    if (it == sizes.end())
      sizes.push_back({{*files[at], *size}, 1});
    else
      ++it->second;
  }
  const auto largest =
      std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return largest == sizes.end() ? std::nullopt : std::optional(largest->first);
}

/// Color size for layouts without a color camera: color is registered to depth, perhaps with another number of pixels.
void find_color_size(Recording& recording) {
  const Camera& depth = recording.rig.depth;
  if (recording.rig.color) return;
  const auto common = common_color(recording.entries);
  if (!common || common->size == Eigen::Vector2i(depth.width, depth.height)) return;
  const auto& [file, size] = *common;
  const double stretch = static_cast<double>(size.x()) * depth.height / (static_cast<double>(size.y()) * depth.width);
  if (!(std::abs(stretch - 1) <= kMaxAspectError)) {
    spdlog::warn(
        fmt::format("{}: is {}x{}, another aspect ratio than depth's {}x{}: color is not used; give its camera under "
                    "`color` in camera.yaml if the layout has one",
                    file.string(), size.x(), size.y(), depth.width, depth.height));
    return;
  }
  Rig rig = recording.rig;
  rig.color = ColorCamera{.camera = scaled_to(depth, size)};
  try {
    check(rig);
    recording.rig = rig;
  } catch (const std::runtime_error& error) {
    spdlog::warn(fmt::format("{}: {}; color is not used", file.string(), error.what()));
  }
}

class RecordingSource final : public Source {
 public:
  RecordingSource(Recording recording, const FrameRange& range, bool depth_only = false)
      : recording_(std::move(recording)), range_(range), depth_only_(depth_only) {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // errors go into Frame::problem
    find_color_size(recording_);
    depth_of_ = recording_.rig.depth, color_of_ = recording_.rig.color_view();
    end_ = static_cast<int>(recording_.entries.size());
    if (range.end) end_ = std::min(end_, *range.end);
    next_ = range.begin;
  }

  const Rig& rig() const override { return recording_.rig; }
  std::string layout() const override { return recording_.layout; }
  std::optional<int> size() const override {
    return std::max(0, (end_ - range_.begin + range_.step - 1) / range_.step);
  }

  std::optional<double> next_timestamp() const override {
    if (next_ >= end_) return std::nullopt;
    return recording_.entries[static_cast<std::size_t>(next_)].timestamp;
  }
  void skip() override { next_ += range_.step; }

  bool has_assumed_rate() const override { return recording_.has_assumed_rate; }
  std::optional<std::string> ended_early() const override {
    return next_ < static_cast<int>(recording_.entries.size()) ? std::nullopt : recording_.ended_early;
  }

  std::optional<Frame> next() override {
    if (next_ >= end_) {
      warn_about_missing_color();
      return std::nullopt;
    }
    const auto& entry = recording_.entries[static_cast<std::size_t>(next_)];
    Frame frame{
        .index = next_, .timestamp = entry.timestamp, .world_from_camera = {}, .acceleration = entry.acceleration};
    next_ += range_.step;
    if (entry.timestamp <= last_timestamp_) {
      frame.problem = entry.depth.string() + ": its timestamp is not after the previous one";
      return frame;
    }
    last_timestamp_ = entry.timestamp;
    set_camera_of(entry);
    const double read_out = entry.timestamp + 0.5 * recording_.rig.depth.readout;
    for (; gyro_ < recording_.gyro.size() && recording_.gyro[gyro_].timestamp <= read_out; ++gyro_)
      frame.gyro.push_back(recording_.gyro[gyro_]);
    const auto& accelerations = recording_.accelerations;
    for (; acceleration_ < accelerations.size() && accelerations[acceleration_].timestamp <= read_out; ++acceleration_)
      frame.accelerations.push_back(accelerations[acceleration_]);
    std::optional<std::string> color_problem;
    tbb::parallel_invoke(
        [&] {
          frame.problem = problem_of([&] {
            frame.depth = read_depth(entry.depth);
            if (!entry.confidence.empty()) frame.confidence = read_confidence(entry.confidence);
          });
        },
        [&] {
          if (depth_only_) return;
          color_problem = problem_of([&] {
            if (!entry.color.empty()) frame.color = read_color(entry.color);
            if (recording_.color_of) frame.color = recording_.color_of(frame.index);
            frame.color_delay = entry.color_delay;
          });
        });
    if (frame.problem) {
      frame.problem = entry.depth.string() + ": " + *frame.problem;
      frame.color.clear();
    } else if (color_problem && ++colorless_ == 1) {  // frames without color are still valid
      first_colorless_ = entry.color.string() + ": " + *color_problem;
    }
    return frame;
  }

 private:
  /// Runs `read` and returns its error, if any.
  template <class Read>
  [[nodiscard]] static std::optional<std::string> problem_of(Read&& read) {
    try {
      read();
      return std::nullopt;
    } catch (const std::exception& error) {
      return error.what();
    }
  }

  /// Warns at the end, once.
  void warn_about_missing_color() {
    if (colorless_ > 0)
      spdlog::warn("{} of {} color images are not used, their frames have depth only; the first: {}", colorless_,
                   (end_ - range_.begin + range_.step - 1) / range_.step, first_colorless_);
    colorless_ = 0;
  }

  /// Sets up resampling if the camera differs from the previous frame's.
  void set_camera_of(const Recording::Entry& entry) {
    if (entry.camera == camera_ || (entry.camera && camera_ && *entry.camera == *camera_)) return;
    camera_ = entry.camera;
    depth_of_ = recording_.rig.depth, color_of_ = recording_.rig.color_view();
    if (camera_) {
      depth_of_ = scaled_to(*camera_, scaled_size(*camera_, depth_of_));
      color_of_ = scaled_to(*camera_, scaled_size(*camera_, color_of_));
    }
    depth_resampler_ = Resampler(recording_.rig.depth, depth_of_, kMaxShift);
    color_resampler_ = Resampler(recording_.rig.color_view(), color_of_, kMaxShift);
  }
  /// Image size for a frame's camera, scaled by its size relative to the first frame's camera.
  [[nodiscard]] Eigen::Vector2i scaled_size(const Camera& camera, const Camera& image) const {
    const Camera& first = *recording_.entries[0].camera;
    const auto side = [](int own, int its, int of) {
      return static_cast<int>(std::lround(static_cast<double>(own) * its / of));
    };
    return {side(camera.width, image.width, first.width), side(camera.height, image.height, first.height)};
  }

  /// Stored size of depth images: the camera's, or larger if the images were enlarged.
  [[nodiscard]] cv::Size stored_size() const {
    const auto& [stored, columns, rows] = recording_.blocks;
    if (columns.empty()) return {depth_of_.width, depth_of_.height};
    return {stored.x(), stored.y()};
  }

  /// Returns `image` at its true resolution. Throws if the size differs from the expected size.
  [[nodiscard]] cv::Mat at_true_size(const cv::Mat& image, const char* what) const {
    const Camera& c = depth_of_;
    const auto& [stored, columns, rows] = recording_.blocks;
    const cv::Size expected = stored_size();
    if (image.cols != expected.width || image.rows != expected.height)
      throw std::runtime_error(
          fmt::format("{} {}x{}, the camera {}x{}", what, image.cols, image.rows, expected.width, expected.height));
    if (columns.empty()) return image;
    cv::Mat reduced(c.height, c.width, image.type());
    const std::size_t bytes = image.elemSize();
    for (int y = 0; y < c.height; ++y)
      for (int x = 0; x < c.width; ++x)
        std::memcpy(reduced.ptr(y, x),
                    image.ptr(rows[static_cast<std::size_t>(y)], columns[static_cast<std::size_t>(x)]), bytes);
    return reduced;
  }

  std::vector<float> read_depth(const fs::path& file) const {
    const Camera& c = depth_of_;
    cv::Mat image = decode_depth(read_whole(file), {.size = stored_size()});
    if (image.type() != CV_16UC1 && image.type() != CV_32FC1)
      throw std::runtime_error(
          fmt::format("has {} of 8 bits; depth must be a 16-bit image with one channel",
                      image.channels() == 1 ? "one channel" : fmt::format("{} channels", image.channels())));
    image = at_true_size(image, "is");
    if (recording_.bytes_are_swapped && image.type() == CV_16UC1)
      for (int i = 0; i < static_cast<int>(image.total()); ++i) {
        auto& value = image.ptr<std::uint16_t>()[i];
        value = static_cast<std::uint16_t>(value << 8 | value >> 8);
      }
    std::vector<float> depth(static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height));
    const float meters = static_cast<float>(1.0 / recording_.depth_scale);
    const int invalid = recording_.invalid_depth;
    bool any = false;
    for (int y = 0; y < c.height; ++y) {
      float* out = &depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width)];
      if (image.type() == CV_16UC1) {
        const auto* row = image.ptr<std::uint16_t>(y);
        for (int x = 0; x < c.width; ++x) out[x] = row[x] == invalid ? 0.0f : static_cast<float>(row[x]) * meters;
      } else {
        const auto* row = image.ptr<float>(y);
        for (int x = 0; x < c.width; ++x) {
          const float z = row[x] * meters;
          out[x] = z > 0 && z < kMaxDepth ? z : 0.0f;  // also drops NaN
        }
      }
      any = any || std::any_of(out, out + c.width, [](float z) { return z > 0; });
    }
    if (!any) throw std::runtime_error("holds no measurement");
    return depth_resampler_.depth(std::move(depth));
  }

  std::vector<std::uint8_t> read_confidence(const fs::path& file) const {
    const Camera& c = depth_of_;
    const cv::Size size(c.width, c.height), stored = stored_size();
    cv::Mat image;
    try {
      image = decode_image(read_whole(file), Pixels::as_stored,
                           size == stored ? ImageBound{.size = size}
                                          : ImageBound{.size = {}, .max_side = std::max(stored.width, stored.height)});
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(std::string("its confidence ") + error.what());
    }
    if (image.size() != size) image = at_true_size(image, "its confidence is");
    if (image.type() != CV_8UC1) throw std::runtime_error("its confidence must be an 8-bit image with one channel");
    if (recording_.max_confidence < 255) image.convertTo(image, CV_8U, 255 / recording_.max_confidence);
    return depth_resampler_.confidence({image.datastart, image.dataend});
  }

  std::vector<std::uint32_t> read_color(const fs::path& file) const {
    const Camera& c = color_of_;
    return color_resampler_.color(color_pixels(
        decode_image(read_whole(file), Pixels::rgba, {.size = {c.width, c.height}, .camera = "color camera"})));
  }

  Recording recording_;
  FrameRange range_;
  bool depth_only_;
  int next_ = 0, end_ = 0;
  std::shared_ptr<const Camera> camera_;  // camera of the current frame
  Camera depth_of_, color_of_;            // cameras of its images
  Resampler depth_resampler_, color_resampler_;
  std::size_t gyro_ = 0, acceleration_ = 0;  // first samples not yet assigned to a frame
  double last_timestamp_ = -INFINITY;
  int colorless_ = 0;  // frames with an unusable color image
  std::string first_colorless_;
};

/// Sets a pose field of each frame by its time.
class WithPoses final : public WrappedSource {
 public:
  using Field = std::optional<Eigen::Isometry3d> Frame::*;
  WithPoses(std::unique_ptr<Source> source, Trajectory poses, double max_gap, Field field)
      : WrappedSource(std::move(source)), poses_(std::move(poses)), max_gap_(max_gap), field_(field) {}
  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (frame && !frame->problem) (*frame).*field_ = pose_at(poses_, frame->timestamp, max_gap_);
    return frame;
  }

 private:
  Trajectory poses_;
  double max_gap_;
  Field field_;
};

class HoldOutSource final : public WrappedSource {
 public:
  HoldOutSource(std::unique_ptr<Source> source, const HoldOut& which)
      : WrappedSource(std::move(source)), which_(which) {}
  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (frame) frame->held_out = is_held_out(frame->index - which_.range.begin);
    return frame;
  }
  std::optional<double> next_timestamp() const override { return source_->next_timestamp(); }
  void skip() override { source_->skip(); }

 private:
  [[nodiscard]] bool is_held_out(int from_begin) const {
    const int step = which_.range.step;
    return from_begin >= 0 && from_begin % step == 0 && (from_begin / step + 1) % which_.every == 0;
  }
  HoldOut which_;
};

}  // namespace

std::optional<Eigen::Vector2i> size_of_image(const fs::path& file) {
  try {
    const auto bytes = read_whole(file);
    const cv::Mat image = is_tiff(bytes) && !is_depth_tiff(bytes) ? decode_color_tiff(bytes) : decode_depth(bytes);
    return Eigen::Vector2i(image.cols, image.rows);
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

std::optional<Eigen::Vector2i> common_color_size(const std::vector<Recording::Entry>& entries) {
  const auto common = common_color(entries);
  return common ? std::optional(common->size) : std::nullopt;
}

Camera scaled_to(const Camera& camera, const Eigen::Vector2i& size) {
  const double sx = static_cast<double>(size.x()) / camera.width, sy = static_cast<double>(size.y()) / camera.height;
  Camera c = camera;
  c.width = size.x();
  c.height = size.y();
  c.fx *= sx;
  c.fy *= sy;
  c.cx = (c.cx + 0.5) * sx - 0.5;
  c.cy = (c.cy + 0.5) * sy - 0.5;
  return c;
}

void set_registered_rig(const Camera& color, Recording& recording) {
  recording.rig = color;
  for (const auto& entry : recording.entries) {
    const auto size = size_of_image(entry.depth);
    if (!size) continue;
    if (*size == Eigen::Vector2i(color.width, color.height)) return;
    const double stretch =
        static_cast<double>(size->x()) * color.height / (static_cast<double>(size->y()) * color.width);
    if (!(std::abs(stretch - 1) <= kMaxAspectError))
      throw std::runtime_error(
          fmt::format("{}: is {}x{}, another aspect ratio than the camera's {}x{}; depth must be registered to color",
                      entry.depth.string(), size->x(), size->y(), color.width, color.height));
    recording.rig = scaled_to(color, *size);
    if (std::any_of(recording.entries.begin(), recording.entries.end(), [](const auto& e) { return !e.color.empty(); }))
      recording.rig.color = ColorCamera{.camera = color};
    check(recording.rig);
    return;
  }
}

void set_frame_cameras(const std::vector<Camera>& cameras, Recording& recording) {
  set_registered_rig(cameras.at(0), recording);
  if (std::all_of(cameras.begin(), cameras.end(), [&](const Camera& c) { return c == cameras[0]; })) return;
  std::shared_ptr<const Camera> last;
  double min_fx = cameras[0].fx, max_fx = min_fx;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (!last || *last != cameras[i]) last = std::make_shared<const Camera>(cameras[i]);
    recording.entries[i].camera = last;
    min_fx = std::min(min_fx, cameras[i].fx), max_fx = std::max(max_fx, cameras[i].fx);
  }
  recording.interpretations.push_back(
      {"intrinsics", fmt::format("per frame, fx {:.2f} to {:.2f} pixels: frames are resampled into the first camera",
                                 min_fx, max_fx)});
}

std::unique_ptr<Source> open_recording(const fs::path& folder, const SourceOptions& options) {
  Recording recording = analyze_recording(folder, options.camera);
  for (const std::string& warning : recording.warnings) spdlog::warn("{}: {}", folder.string(), warning);
  for (const std::string& note : recording.notes) spdlog::info("{}: {}", folder.string(), note);
  if (options.camera.empty() && options.find_color_camera && !recording.has_color_camera) {
    RecordingSource all(recording, {});
    if (const auto rig = find_color_camera(all)) {
      recording.rig = *rig;
      if (recording.rig.color) recording.rig.color->camera.readout = recording.color_readout;
    }
  }
  const Trajectory by_device = recording.has_device_poses ? recording.truth : Trajectory{};
  auto source = std::make_unique<RecordingSource>(std::move(recording), options.range, options.depth_only);
  if (by_device.empty()) return source;
  return with_guesses(std::move(source), by_device);
}

std::vector<Interpretation> interpretation_of(const std::string& recording, const SourceOptions& options) {
  if (const auto segment = read_segment(recording)) return interpretation_of(segment->recording, options);
  if (is_zip(recording))
    return unpacked(recording)->with_archive_name(
        [&](const std::string& content) { return interpretation_of(content, options); });
  if (!fs::is_directory(recording) || is_ros_recording(recording)) return {};
  return analyze_recording(recording, options.camera).interpretations;
}

std::unique_ptr<Source> with_poses(std::unique_ptr<Source> source, Trajectory world_from_camera, double max_gap) {
  return std::make_unique<WithPoses>(std::move(source), std::move(world_from_camera), max_gap,
                                     &Frame::world_from_camera);
}

std::unique_ptr<Source> hold_out(std::unique_ptr<Source> source, const HoldOut& which) {
  if (which.every == 0) return source;
  if (which.every < 2)
    throw std::runtime_error(
        fmt::format("frames cannot be held out at an interval of {}: give 2 or more, for example 10", which.every));
  return std::make_unique<HoldOutSource>(std::move(source), which);
}

std::unique_ptr<Source> with_guesses(std::unique_ptr<Source> source, Trajectory guesses, double max_gap) {
  return std::make_unique<WithPoses>(std::move(source), std::move(guesses), max_gap, &Frame::guess);
}

Trajectory device_poses(const fs::path& recording, const fs::path& camera) {
  if (const auto segment = read_segment(recording)) return device_poses(segment->recording, camera);
  if (is_zip(recording))
    return unpacked(recording)->with_archive_name(
        [&](const std::string& content) { return device_poses(content, camera); });
  if (!fs::is_directory(recording) || is_ros_recording(recording)) return {};
  Recording read = read_with_camera(recording, camera);
  return read.has_device_poses ? std::move(read.truth) : Trajectory{};
}

Trajectory recorded_truth(const fs::path& recording) {
  if (is_synthetic(recording.string())) return synthetic_truth(recording.string().substr(kSynthetic.size()));
  if (const auto segment = read_segment(recording)) return recorded_truth(segment->recording);
  if (is_zip(recording))
    return unpacked(recording)->with_archive_name([](const std::string& content) { return recorded_truth(content); });
  if (is_ros_recording(recording)) return {};
  if (fs::is_directory(recording) || !fs::exists(recording)) return read_with_camera(recording, {}).truth;
  const std::string extension = extension_of(recording);
  if (extension == ".mkv" || extension == ".oni") return {};
  return extension == ".sens" ? sens_truth(recording) : read_trajectory(recording);
}

}  // namespace cairn
