// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>

#include "base/file_name.hpp"
#include "cairn/io/source.hpp"
#include "geometry/color_view.hpp"
#include "io/camera_file.hpp"
#include "io/datasets/azure_kinect.hpp"
#include "io/datasets/record3d.hpp"
#include "io/datasets/sens.hpp"
#include "io/datasets/zip_recording.hpp"
#include "io/recording.hpp"
#include "io/recording_segment.hpp"
#include "io/reproject_to.hpp"
#include "io/ros/ros_recording.hpp"
#include "io/ros/ros_source.hpp"
#include "io/sensors/k4a.hpp"
#include "io/sensors/network_camera.hpp"
#include "io/sensors/openni.hpp"
#include "io/sensors/realsense.hpp"
#include "synth/source.hpp"

namespace cairn {
namespace {

constexpr std::string_view kOpenNi = "openni:", kRealSense = "realsense:", kK4a = "k4a:";

/// Frame range of a source that only supports sequential reading.
class InRange final : public WrappedSource {
 public:
  InRange(std::unique_ptr<Source> source, const FrameRange& range)
      : WrappedSource(std::move(source)), range_(range), next_(range.begin) {}
  std::optional<int> size() const override {
    const auto all = source_->size();
    if (!all) return all;
    return std::max(
        0, (std::min(read_ + *all, range_.end.value_or(read_ + *all)) - next_ + range_.step - 1) / range_.step);
  }
  std::optional<Frame> next() override {
    if (range_.end && next_ >= *range_.end) return std::nullopt;
    Frame skipped;  // samples of the skipped frames
    while (auto frame = source_->next()) {
      if (read_++ == next_) {
        next_ += range_.step;
        frame->gyro.insert(frame->gyro.begin(), skipped.gyro.begin(), skipped.gyro.end());
        frame->accelerations.insert(frame->accelerations.begin(), skipped.accelerations.begin(),
                                    skipped.accelerations.end());
        return frame;
      }
      if (read_ <= range_.begin) continue;
      skipped.gyro.insert(skipped.gyro.end(), frame->gyro.begin(), frame->gyro.end());
      skipped.accelerations.insert(skipped.accelerations.end(), frame->accelerations.begin(),
                                   frame->accelerations.end());
    }
    return std::nullopt;
  }

 private:
  FrameRange range_;
  int read_ = 0, next_;
};

/// Source with cameras given by the user.
class WithCameras final : public WrappedSource {
 public:
  WithCameras(std::unique_ptr<Source> source, const Rig& rig) : WrappedSource(std::move(source)), rig_(rig) {}
  const Rig& rig() const override { return rig_; }
  std::optional<double> next_timestamp() const override { return source_->next_timestamp(); }
  void skip() override { source_->skip(); }
  std::optional<Frame> next() override { return source_->next(); }

 private:
  Rig rig_;
};

/// Frames of a recording in an archive.
class ZipSource final : public WrappedSource {
 public:
  ZipSource(std::shared_ptr<const UnpackedZip> zip, std::unique_ptr<Source> source)
      : WrappedSource(std::move(source)), zip_(std::move(zip)) {}
  ~ZipSource() override { source_.reset(); }  // before its files are removed
  std::string layout() const override { return source_->layout() + ", packed as .zip"; }
  std::optional<std::string> ended_early() const override { return named(source_->ended_early()); }
  std::optional<double> next_timestamp() const override { return source_->next_timestamp(); }
  void skip() override { source_->skip(); }
  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (frame) frame->problem = named(std::move(frame->problem));
    return frame;
  }

 private:
  [[nodiscard]] std::optional<std::string> named(std::optional<std::string> text) const {
    if (text) text = zip_->by_archive_name(*std::move(text));
    return text;
  }
  std::shared_ptr<const UnpackedZip> zip_;
};

/// Frames of a recording segment.
class SegmentSource final : public WrappedSource {
 public:
  SegmentSource(std::unique_ptr<Source> source, std::string segment)
      : WrappedSource(std::move(source)), name_(std::move(segment)) {}
  std::string layout() const override { return fmt::format("part {} of a plan: {}", name_, source_->layout()); }
  std::optional<double> next_timestamp() const override { return source_->next_timestamp(); }
  void skip() override { source_->skip(); }
  std::optional<Frame> next() override { return source_->next(); }

 private:
  std::string name_;
};

class RegisteredColorSource final : public WrappedSource {
 public:
  explicit RegisteredColorSource(std::unique_ptr<Source> source)
      : WrappedSource(std::move(source)), view_(source_->rig()), rig_(source_->rig()) {
    rig_.color.reset();
  }
  const Rig& rig() const override { return rig_; }
  std::optional<double> next_timestamp() const override { return source_->next_timestamp(); }
  void skip() override { source_->skip(); }
  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (frame) frame = view_.on_depth(*std::move(frame));
    return frame;
  }

 private:
  ColorView view_;
  Rig rig_;
};

}  // namespace

std::unique_ptr<Source> with_color_on_depth(std::unique_ptr<Source> source) {
  return source->rig().color ? std::make_unique<RegisteredColorSource>(std::move(source)) : std::move(source);
}

std::unique_ptr<Source> with_cameras(std::unique_ptr<Source> source, const std::filesystem::path& camera_file) {
  if (camera_file.empty()) return source;
  Rig rig = rig_named(camera_file, source->rig());
  if (rig.sensor == SensorModel{}) rig.sensor = source->rig().sensor;
  if (rig.depth_correction.empty()) rig.depth_correction = source->rig().depth_correction;
  if (!rig.camera_from_imu) rig.camera_from_imu = source->rig().camera_from_imu;
  return std::make_unique<WithCameras>(std::move(source), rig);
}

bool is_sensor(std::string_view name) {
  return (name.starts_with(kOpenNi) && extension_of(name) != ".oni") || name.starts_with(kRealSense) ||
         name.starts_with(kK4a) || name.starts_with(kRos2) || is_network_camera(name);
}

bool is_synthetic(std::string_view name) { return name.starts_with(kSynthetic); }

namespace {

/// Resamples frames of a segment recorded with another camera than its project's.
std::unique_ptr<Source> in_project_camera(const std::string& segment, std::unique_ptr<Source> source) {
  const Rig rig = read_rig(std::filesystem::path(segment) / kPartCamera);
  try {
    return reproject_to(std::move(source), rig);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format(
        "{}: the camera of its recording has changed since it was planned: {}; restore it", segment, error.what()));
  }
}

std::unique_ptr<Source> open_segment(const std::string& folder, const RecordingSegment& segment,
                                     SourceOptions options) {
  std::error_code ignored;
  if (!is_synthetic(segment.recording) && !std::filesystem::exists(segment.recording, ignored))
    throw std::runtime_error(fmt::format("{}: its recording, {}, is missing: restore it", folder, segment.recording));
  const FrameRange range = options.range = to_recording_range(segment, options.range);
  auto source = open_source(segment.recording, options);
  const int frames = *range.end > range.begin ? (*range.end - range.begin - 1) / range.step + 1 : 0;
  if (const auto size = source->size(); size && *size < frames)
    throw std::runtime_error(fmt::format("{}: its recording, {}, has fewer frames than when it was planned: restore it",
                                         folder, segment.recording));
  if (segment.other_camera) source = in_project_camera(folder, std::move(source));
  return std::make_unique<SegmentSource>(std::move(source), segment.name);
}

std::unique_ptr<Source> open_by_name(const std::string& name, const SourceOptions& options) {
  if (const auto segment = read_segment(name)) return open_segment(name, *segment, options);
  const std::string extension = extension_of(name);
  if (name.starts_with(kRealSense) || name.starts_with(kK4a)) {
    auto source =
        name.starts_with(kK4a) ? open_k4a(name.substr(kK4a.size())) : open_realsense(name.substr(kRealSense.size()));
    return with_cameras(std::make_unique<InRange>(std::move(source), options.range), options.camera);
  }
  if (is_network_camera(name))
    return with_cameras(std::make_unique<InRange>(open_network_camera(name, options.tracking), options.range),
                        options.camera);
  if (name.starts_with(kOpenNi) || extension == ".oni") {
    const std::string uri = name.starts_with(kOpenNi) ? name.substr(kOpenNi.size()) : name;
    return std::make_unique<InRange>(open_openni(uri, {.camera = options.camera, .copy_to = options.copy_to}),
                                     options.range);
  }
  if (is_synthetic(name) && !options.camera.empty())
    throw std::runtime_error(name + ": has its own camera: SourceOptions::camera is only for recordings and sensors");
  if (is_synthetic(name))
    return open_synthetic({.scene = name.substr(kSynthetic.size()),
                           .first = options.range.begin,
                           .frames = options.range.end,
                           .step = options.range.step});
  if (is_zip(name)) {
    auto zip = unpacked(name);
    if (zip->damage()) spdlog::warn(*zip->damage());
    auto source = zip->with_archive_name([&](const std::string& content) { return open_source(content, options); });
    return std::make_unique<ZipSource>(std::move(zip), std::move(source));
  }
  if (extension == ".r3d") throw std::runtime_error(r3d_advice(name));
  if (extension == ".mkv")
    return with_cameras(std::make_unique<InRange>(open_azure_kinect(name), options.range), options.camera);
  if (is_ros_recording(name))
    return with_cameras(std::make_unique<InRange>(open_ros(name, options), options.range), options.camera);
  if (extension == ".sens") return with_cameras(open_sens(name, options.range, options.depth_only), options.camera);
  return open_recording(name, options);
}

}  // namespace

std::unique_ptr<Source> open_source(const std::string& name, const SourceOptions& options) {
  auto source = open_by_name(name, options);
  if (!options.sensor) return source;
  Rig rig = source->rig();
  rig.sensor = *options.sensor;
  return std::make_unique<WithCameras>(std::move(source), rig);
}

}  // namespace cairn
