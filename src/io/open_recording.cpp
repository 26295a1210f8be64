// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <cmath>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "base/image_file.hpp"
#include "base/read_whole.hpp"
#include "cairn/source.hpp"
#include "io/recording.hpp"
#include "io/sens.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

Recording read_recording(const fs::path& folder) {
  if (!fs::exists(folder)) throw std::runtime_error(folder.string() + ": there is no such folder");
  if (!fs::is_directory(folder))
    throw std::runtime_error(folder.string() + ": is not a folder; give the folder that holds the recording");
  for (const auto read : {read_tum, read_icl_nuim, read_seven_scenes, read_stray_scanner, read_intrinsics_folder})
    if (auto recording = read(folder)) return *std::move(recording);
  throw std::runtime_error(folder.string() +
                           ": no known recording; expected rgb.txt and depth.txt (TUM), frame-000000.depth.png "
                           "(7-Scenes), associations.txt (ICL-NUIM), rgb.mp4 (Stray Scanner) or intrinsics.json");
}

class RecordingSource final : public Source {
 public:
  RecordingSource(Recording recording, const FrameRange& range) : recording_(std::move(recording)), range_(range) {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // what is wrong goes into Frame::problem
    end_ = static_cast<int>(recording_.entries.size());
    if (range.end) end_ = std::min(end_, *range.end);
    next_ = range.begin;
  }

  const Rig& rig() const override { return recording_.rig; }
  std::optional<int> size() const override {
    return std::max(0, (end_ - range_.begin + range_.step - 1) / range_.step);
  }

  std::optional<double> next_timestamp() const override {
    if (next_ >= end_) return std::nullopt;
    return recording_.entries[static_cast<std::size_t>(next_)].timestamp;
  }
  void skip() override { next_ += range_.step; }

  std::optional<std::string> ended_early() const override {
    return next_ < static_cast<int>(recording_.entries.size()) ? std::nullopt : recording_.ended_early;
  }

  std::optional<Frame> next() override {
    if (next_ >= end_) return std::nullopt;
    const auto& entry = recording_.entries[static_cast<std::size_t>(next_)];
    Frame frame{
        .index = next_, .timestamp = entry.timestamp, .world_from_camera = {}, .acceleration = entry.acceleration};
    next_ += range_.step;
    if (entry.timestamp <= last_timestamp_) {
      frame.problem = entry.depth.string() + ": its timestamp does not come after the one before";
      return frame;
    }
    last_timestamp_ = entry.timestamp;
    try {
      frame.depth = read_depth(entry.depth, entry.confidence);
    } catch (const std::exception& error) {
      frame.problem = entry.depth.string() + ": " + error.what();
      return frame;
    }
    try {
      if (!entry.colour.empty()) frame.colour = read_colour(entry.colour);
      if (recording_.colour_of) frame.colour = recording_.colour_of(frame.index);
      frame.colour_delay = entry.colour_delay;
    } catch (const std::exception&) {
      // Depth alone is still a frame.
    }
    return frame;
  }

 private:
  std::vector<float> read_depth(const fs::path& file, const fs::path& confidence_file) const {
    const Camera& c = recording_.rig.depth;
    const cv::Mat image = decode_image(read_whole(file), cv::IMREAD_UNCHANGED);
    if (image.type() != CV_16UC1) throw std::runtime_error("depth must be a 16-bit image with one channel");
    if (image.cols != c.width || image.rows != c.height)
      throw std::runtime_error("is " + std::to_string(image.cols) + "x" + std::to_string(image.rows) + ", the camera " +
                               std::to_string(c.width) + "x" + std::to_string(c.height));
    cv::Mat confidence;
    if (!confidence_file.empty()) {
      confidence = decode_image(read_whole(confidence_file), cv::IMREAD_UNCHANGED);
      if (confidence.type() != CV_8UC1 || confidence.size() != image.size())
        throw std::runtime_error("its confidence must be an 8-bit image with one channel and of the same size");
    }
    std::vector<float> depth(static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height));
    const float metres = static_cast<float>(1.0 / recording_.depth_scale);
    const int invalid = recording_.invalid_depth;
    bool any = false;
    for (int y = 0; y < c.height; ++y) {
      const auto* row = image.ptr<std::uint16_t>(y);
      float* out = &depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width)];
      for (int x = 0; x < c.width; ++x) {
        const bool doubtful = !confidence.empty() && confidence.at<std::uint8_t>(y, x) == 0;
        out[x] = row[x] == invalid || doubtful ? 0.0f : static_cast<float>(row[x]) * metres;
        any |= out[x] > 0;
      }
    }
    if (!any) throw std::runtime_error("holds no measurement");
    return depth;
  }

  /// Empty when its shape is not its camera's.
  std::vector<std::uint32_t> read_colour(const fs::path& file) const {
    const Camera& c = recording_.rig.colour_view();
    cv::Mat image = decode_image(read_whole(file), cv::IMREAD_COLOR), rgba;
    if (std::int64_t{image.cols} * c.height != std::int64_t{image.rows} * c.width) return {};
    if (image.cols != c.width) cv::resize(image, image, {c.width, c.height}, 0, 0, cv::INTER_AREA);
    cv::cvtColor(image, rgba, cv::COLOR_BGR2RGBA);
    const auto* data = rgba.ptr<std::uint32_t>();
    return {data, data + rgba.total()};
  }

  Recording recording_;
  FrameRange range_;
  int next_ = 0, end_ = 0;
  double last_timestamp_ = -INFINITY;
};

class WithPoses final : public WrappedSource {
 public:
  WithPoses(std::unique_ptr<Source> source, Trajectory poses, double max_gap)
      : WrappedSource(std::move(source)), poses_(std::move(poses)), max_gap_(max_gap) {}
  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (frame && !frame->problem) frame->world_from_camera = pose_at(poses_, frame->timestamp, max_gap_);
    return frame;
  }

 private:
  Trajectory poses_;
  double max_gap_;
};

}  // namespace

std::unique_ptr<Source> open_recording(const fs::path& folder, const FrameRange& range, const fs::path& camera) {
  Recording recording = read_recording(folder);
  if (!camera.empty()) recording.rig = read_rig(camera);
  return std::make_unique<RecordingSource>(std::move(recording), range);
}

std::unique_ptr<Source> with_poses(std::unique_ptr<Source> source, Trajectory world_from_camera, double max_gap) {
  return std::make_unique<WithPoses>(std::move(source), std::move(world_from_camera), max_gap);
}

Trajectory recorded_truth(const fs::path& recording) {
  if (fs::is_directory(recording) || !fs::exists(recording)) return read_recording(recording).truth;
  return recording.extension() == ".sens" ? sens_truth(recording) : read_trajectory(recording);
}

}  // namespace cairn
