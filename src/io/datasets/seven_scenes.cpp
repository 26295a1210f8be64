// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// 7-Scenes (Shotton et al. 2013): frame-000000.{depth.png,color.png or jpg,pose.txt}, depth in millimeters.
#include <fmt/format.h>

#include <stdexcept>

#include "base/lines.hpp"
#include "base/words.hpp"
#include "cairn/io/known_cameras.hpp"
#include "io/datasets/image_names.hpp"
#include "io/recording.hpp"
#include "io/sensors/kinect.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kFrameRate = 30.0;  // Hz; the data set has no timestamps

/// Returns the number in frame-000012.depth.png.
std::optional<int> number_of_image(const fs::path& image) {
  const std::string stem = image.filename().string();
  constexpr std::string_view kBefore = "frame-", kAfter = ".depth.png";
  if (stem.size() != kBefore.size() + 6 + kAfter.size() || !stem.starts_with(kBefore) || !stem.ends_with(kAfter))
    return std::nullopt;
  const auto number = number_in<int>(std::string_view(stem).substr(kBefore.size(), 6));
  return number && *number >= 0 ? number : std::nullopt;
}

Eigen::Isometry3d read_pose(const fs::path& file) {
  std::vector<double> v;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    for (const auto& word : words) v.push_back(number_of(word, file, line));
  });
  if (v.size() != 16) throw std::runtime_error(file.string() + ": expected a 4x4 matrix");
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 4; ++c) pose.matrix()(r, c) = v[static_cast<std::size_t>(4 * r + c)];
  pose.linear() = Eigen::Quaterniond(pose.linear()).normalized().toRotationMatrix();
  if (!pose.matrix().allFinite()) throw std::runtime_error(file.string() + ": its numbers are too large for a pose");
  return pose;
}

}  // namespace

std::optional<Recording> read_seven_scenes(const fs::path& folder) {
  const auto name = [&](int i, const char* suffix) { return folder / fmt::format("frame-{:06}.{}", i, suffix); };
  std::vector<int> numbers;
  for (const fs::path& image : depth_images_in(folder))
    if (const auto number = number_of_image(image)) numbers.push_back(*number);
  if (numbers.empty()) return std::nullopt;
  const Camera camera = known_camera("seven-scenes")->camera;
  // Images with another camera file or of another size do not belong to the data set.
  if (has_other_camera(folder, camera)) return std::nullopt;
  for (const int i : numbers)
    if (const auto size = size_of_image(name(i, "depth.png"))) {
      if (*size != Eigen::Vector2i(camera.width, camera.height)) return std::nullopt;
      break;
    }
  Recording recording;
  recording.layout = "7-Scenes folder";
  recording.rig.depth = camera;
  recording.frame_rate = kFrameRate;
  recording.interpretations.push_back({"camera of", "7-Scenes' Kinect, by the names and size of its images"});
  recording.has_color_camera = false;
  recording.color_readout = kKinectColorReadout;
  recording.depth_scale = 1000.0;
  recording.invalid_depth = 65535;
  for (const int i : numbers) {
    const double time = i / kFrameRate;
    fs::path color = name(i, "color.png");
    if (!fs::exists(color)) color = name(i, "color.jpg");
    recording.entries.push_back({time, name(i, "depth.png"), fs::exists(color) ? color : fs::path()});
    if (fs::exists(name(i, "pose.txt"))) recording.truth.push_back({time, read_pose(name(i, "pose.txt"))});
  }
  return recording;
}

}  // namespace cairn
