// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/keyframe_pictures.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "base/image_file.hpp"
#include "map/keyframe.hpp"
#include "net/file_below.hpp"

namespace cairn {
namespace {

constexpr double kMaxTimeDifference = 1e-4;                       // seconds: rounding of the files
constexpr std::size_t kMaxPictureBytes = std::size_t{256} << 20;  // bytes

}  // namespace

std::optional<SessionPictures> pictures_of(const std::filesystem::path& folder, const std::vector<double>& timestamps) {
  const std::filesystem::path session = folder / "session";
  if (timestamps.empty() || !is_below(session, "state.cbor")) return std::nullopt;
  try {
    SessionPictures pictures = read_pictures(session);
    const auto is_same = [](double a, double b) { return std::abs(a - b) < kMaxTimeDifference; };
    if (std::equal(timestamps.begin(), timestamps.end(), pictures.timestamps.begin(), pictures.timestamps.end(),
                   is_same))
      return pictures;
  } catch (const std::exception&) {
    // The page works without it.
  }
  return std::nullopt;
}

std::vector<KeyframePicture> pictures_along(const Trajectory& path, const SessionPictures& pictures,
                                            double clock_offset) {
  std::vector<KeyframePicture> along;
  double next = std::numeric_limits<double>::infinity();
  for (std::size_t k = pictures.timestamps.size(); k-- > 0;) {  // the last recording's keyframes are at the end
    const double time = pictures.timestamps[k] + clock_offset;
    if (time >= next || path.empty() || time < path.front().timestamp - kMaxTimeDifference) break;
    next = time;
    const auto pose = std::lower_bound(path.begin(), path.end(), time - kMaxTimeDifference,
                                       [](const StampedPose& p, double t) { return p.timestamp < t; });
    if (pose == path.end() || pose->timestamp > time + kMaxTimeDifference) continue;
    if (const auto file = color_file(pictures.keyframes, k); is_below(file.parent_path(), file.filename()))
      along.push_back({.time = pose->timestamp, .file = file});
  }
  std::reverse(along.begin(), along.end());
  return along;
}

std::string small_picture(const std::filesystem::path& file, int width, int quality) {
  std::vector<std::uint8_t> bytes;
  try {
    const std::string read = FileBelow(file.parent_path(), file.filename()).read(kMaxPictureBytes);
    bytes.assign(read.begin(), read.end());
    cv::Mat image = decode_image(bytes, Pixels::rgb);
    if (image.cols > width) {
      cv::resize(image, image, {width, std::max(1, image.rows * width / image.cols)}, 0, 0, cv::INTER_AREA);
      bytes = encode_jpeg(image, {.quality = quality});
    }
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
  return {bytes.begin(), bytes.end()};
}

}  // namespace cairn
