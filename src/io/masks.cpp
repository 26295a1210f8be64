// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/file_name.hpp"
#include "base/image_file.hpp"
#include "base/read_whole.hpp"
#include "cairn/io/mask.hpp"
#include "cairn/io/source.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxTimeDifference = 0.002;  // seconds between a mask's name and an image's time
constexpr const char* kDigits = "0123456789";
constexpr std::uint32_t kNoAlpha = 0x00ffffff;  // bytes R, G, B, 0 in memory order

/// Last number in a file name, without the extension.
std::optional<std::uint64_t> number_of(const fs::path& file) {
  const std::string stem = file.stem().string();
  const std::size_t last = stem.find_last_of(kDigits);
  if (last == stem.npos) return std::nullopt;
  const std::size_t before = stem.find_last_not_of(kDigits, last), begin = before == stem.npos ? 0 : before + 1;
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(stem.data() + begin, stem.data() + last + 1, number);
  return error == std::errc() ? std::optional(number) : std::nullopt;
}

/// Seconds at the end of a file name, DIGITS.DIGITS before the extension.
std::optional<double> seconds_of(const fs::path& file) {
  const std::string stem = file.stem().string();
  const std::size_t point = stem.rfind('.');
  if (point == stem.npos || point == 0 || point + 1 == stem.size() ||
      stem.find_first_not_of(kDigits, point + 1) != stem.npos)
    return std::nullopt;
  const std::size_t before = stem.find_last_not_of(kDigits, point - 1), begin = before == stem.npos ? 0 : before + 1;
  double seconds = 0;
  const auto [end, error] = std::from_chars(stem.data() + begin, stem.data() + stem.size(), seconds);
  return begin < point && error == std::errc() ? std::optional(seconds) : std::nullopt;
}

/// Numbers of a recording's depth images in order; empty if they have none, as in files and lists of times.
std::vector<std::uint64_t> depth_numbers(const std::string& recording) {
  std::error_code ignored;
  if (!fs::is_directory(recording, ignored)) return {};
  for (const char* name : {"depth", "depths", "depth_raw", "results", "."}) {
    std::set<std::uint64_t> numbers;
    for (const auto& entry : fs::directory_iterator(fs::path(recording) / name, ignored)) {
      if (extension_of(entry.path()).empty()) continue;
      if (seconds_of(entry.path())) return {};
      if (const auto number = number_of(entry.path())) numbers.insert(*number);
    }
    if (!numbers.empty()) return {numbers.begin(), numbers.end()};
  }
  return {};
}

/// Files of masks, by frame index or by time.
class MaskFiles {
 public:
  MaskFiles(const fs::path& folder, const std::string& recording) {
    if (!fs::is_directory(folder))
      throw std::runtime_error(folder.string() + ": is not a folder of masks, images as 000012.png");
    const std::vector<std::uint64_t> numbers = depth_numbers(recording);
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (extension_of(entry.path()) != ".png") continue;
      if (const auto seconds = seconds_of(entry.path())) {
        by_time_.emplace(*seconds, entry.path());
        continue;
      }
      const auto number = number_of(entry.path());
      if (!number) continue;
      const auto at = std::lower_bound(numbers.begin(), numbers.end(), *number);
      if (numbers.empty())
        by_index_.emplace(*number, entry.path());
      else if (at != numbers.end() && *at == *number)
        by_index_.emplace(static_cast<std::uint64_t>(at - numbers.begin()), entry.path());
    }
    if (by_time_.empty() && by_index_.empty())
      throw std::runtime_error(folder.string() +
                               ": contains no mask of this recording: name masks by number (000012.png), as the depth "
                               "images, or by seconds (12.345678.png)");
  }
  [[nodiscard]] const fs::path& first() const {
    return by_index_.empty() ? by_time_.begin()->second : by_index_.begin()->second;
  }
  /// Null: none.
  [[nodiscard]] const fs::path* of(const Frame& frame) const {
    if (const auto found = by_index_.find(static_cast<std::uint64_t>(frame.index)); found != by_index_.end())
      return &found->second;
    for (const double time : {frame.timestamp, frame.timestamp + frame.color_delay})
      if (const auto next = by_time_.lower_bound(time - kMaxTimeDifference);
          next != by_time_.end() && next->first <= time + kMaxTimeDifference)
        return &next->second;
    return nullptr;
  }

 private:
  std::map<std::uint64_t, fs::path> by_index_;
  std::map<double, fs::path> by_time_;
};

/// Mask of 8 bits per pixel, nonzero: ignored.
struct Mask {
  cv::Mat ignored;
  bool is_of_color = false;  // of a separate color camera
  [[nodiscard]] bool at(int x, int y) const { return ignored.at<std::uint8_t>(y, x) != 0; }
};

Mask read_mask(const fs::path& file, const Rig& rig) {
  cv::Mat image;
  try {
    image = decode_image(read_whole(file), Pixels::as_stored);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
  const cv::Size depth(rig.depth.width, rig.depth.height), color(rig.color_view().width, rig.color_view().height);
  if (image.size() != depth && image.size() != color)
    throw std::runtime_error(
        fmt::format("{}: has {}x{} pixels; a mask has the size of the depth images ({}x{}){}", file.string(),
                    image.cols, image.rows, depth.width, depth.height,
                    color == depth ? "" : fmt::format(" or of the color images ({}x{})", color.width, color.height)));
  Mask mask{.ignored = cv::Mat::zeros(image.size(), CV_8U), .is_of_color = rig.color && image.size() == color};
  const int channels = image.channels() == 2 ? 1 : std::min(image.channels(), 3);
  for (int c = 0; c < channels; ++c) {
    cv::Mat channel;
    cv::extractChannel(image, channel, c);
    mask.ignored |= channel != 0;
  }
  return mask;
}

/// True if a point in the depth camera's frame is masked in a separate color camera's image.
bool is_masked_in_color(const Mask& mask, const ColorCamera& color, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = color.color_from_depth * point;
  if (p.z() <= 0) return false;
  const Camera& camera = color.camera;
  const Eigen::Vector2d ray = camera.distort(p.head<2>() / p.z());
  const long u = std::lround(camera.fx * ray.x() + camera.cx), v = std::lround(camera.fy * ray.y() + camera.cy);
  return u >= 0 && v >= 0 && u < mask.ignored.cols && v < mask.ignored.rows &&
         mask.at(static_cast<int>(u), static_cast<int>(v));
}

/// Removes masked measurements. `rays`: of the depth pixels, at z = 1.
void apply(const Mask& mask, const Rig& rig, const std::vector<Eigen::Vector2d>& rays, Frame& frame) {
  const int width = rig.depth.width;
  const bool has_registered_color = !rig.color && frame.color.size() == frame.depth.size();
  for (std::size_t i = 0; i < std::min(frame.depth.size(), rays.size()); ++i) {
    const double z = static_cast<double>(frame.depth[i]);
    const bool is_masked = mask.is_of_color ? z > 0 && is_masked_in_color(mask, *rig.color, z * rays[i].homogeneous())
                                            : mask.at(static_cast<int>(i) % width, static_cast<int>(i) / width);
    if (!is_masked) continue;
    frame.depth[i] = 0;
    if (has_registered_color) frame.color[i] &= kNoAlpha;
  }
}

std::vector<Eigen::Vector2d> rays_of(const Camera& camera) {
  std::vector<Eigen::Vector2d> rays;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) rays.push_back(camera.undistorted_ray(x, y));
  return rays;
}

class MaskedSource final : public WrappedSource {
 public:
  MaskedSource(std::unique_ptr<Source> source, const fs::path& folder, const std::string& recording)
      : WrappedSource(std::move(source)), folder_(folder), files_(folder, recording), rays_(rays_of(rig().depth)) {
    (void)read_mask(files_.first(), rig());
  }

  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (!frame) {
      if (missing_ > 0 && !std::exchange(has_warned_, true))
        spdlog::warn("{}: has no mask for {} of {} frames, the first is frame {}; they are used whole",
                     folder_.string(), missing_, frames_, first_missing_);
      return frame;
    }
    if (frame->problem) return frame;
    ++frames_;
    const fs::path* const file = files_.of(*frame);
    if (file == nullptr) {
      if (missing_++ == 0) first_missing_ = frame->index;
      return frame;
    }
    try {
      apply(read_mask(*file, rig()), rig(), rays_, *frame);
    } catch (const std::runtime_error& error) {
      frame->problem = error.what();
      frame->depth.clear(), frame->color.clear(), frame->confidence.clear();
    }
    return frame;
  }
  [[nodiscard]] std::optional<double> next_timestamp() const override { return source_->next_timestamp(); }
  void skip() override { source_->skip(); }

 private:
  fs::path folder_;
  MaskFiles files_;
  std::vector<Eigen::Vector2d> rays_;  // of the depth pixels, at z = 1
  int frames_ = 0, missing_ = 0, first_missing_ = 0;
  bool has_warned_ = false;
};

}  // namespace

std::unique_ptr<Source> with_masks(std::unique_ptr<Source> source, const fs::path& folder,
                                   const std::string& recording) {
  return std::make_unique<MaskedSource>(std::move(source), folder, recording);
}

}  // namespace cairn
