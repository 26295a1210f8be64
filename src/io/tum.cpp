// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// TUM RGB-D benchmark (Sturm et al. 2012): rgb.txt and depth.txt list images with their times.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "base/lines.hpp"
#include "io/camera_file.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kAccelerationWindow = 0.25;  // seconds around a frame, so that the hand's shaking averages out
constexpr double kMaxTimeDifference = 0.02;   // seconds between a depth image and its colour image
constexpr std::size_t kMostNear = 1000;       // colour images at a depth image's time, more than any camera takes

struct Stamped {
  double timestamp;
  fs::path image;
};

std::vector<Stamped> read_list(const fs::path& file) {
  std::vector<Stamped> list;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != 2)
      throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": expected `timestamp path`");
    list.push_back({number_of(words[0], file, line), file.parent_path() / words[1]});
  });
  if (list.empty()) throw std::runtime_error(file.string() + ": lists no image");
  return list;
}

/// For each depth image its colour image, or -1: the closest pairs first, one to one.
std::vector<int> associate(const std::vector<Stamped>& depth, const std::vector<Stamped>& colour) {
  std::vector<int> order(colour.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  const auto time = [&](int i) { return colour[static_cast<std::size_t>(i)].timestamp; };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return time(a) < time(b); });
  std::vector<std::tuple<double, int, int>> pairs;  // difference, depth, colour
  for (std::size_t d = 0; d < depth.size(); ++d) {
    auto it = std::lower_bound(order.begin(), order.end(), depth[d].timestamp - kMaxTimeDifference,
                               [&](int i, double t) { return time(i) < t; });
    const std::size_t known = pairs.size();
    for (; it != order.end() && time(*it) <= depth[d].timestamp + kMaxTimeDifference; ++it) {
      if (pairs.size() - known == kMostNear)
        throw std::runtime_error(fmt::format("rgb.txt: lists more than {} images within {} s of each other", kMostNear,
                                             2 * kMaxTimeDifference));
      pairs.emplace_back(std::abs(time(*it) - depth[d].timestamp), static_cast<int>(d), *it);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<int> match(depth.size(), -1);
  std::vector<bool> taken(colour.size(), false);
  for (const auto& [difference, d, c] : pairs) {
    if (match[static_cast<std::size_t>(d)] >= 0 || taken[static_cast<std::size_t>(c)]) continue;
    match[static_cast<std::size_t>(d)] = c;
    taken[static_cast<std::size_t>(c)] = true;
  }
  return match;
}

void use(const CameraFile& file, Recording& recording) {
  recording.rig = file.rig;
  recording.depth_scale = *file.depth_scale;
}

/// Calibrations published with the benchmark.
bool known_camera(const fs::path& folder, Camera& camera) {
  const std::string name = fs::weakly_canonical(folder).filename().string();
  const auto is = [&](const char* a, const char* b) { return name.find(a) != name.npos || name.find(b) != name.npos; };
  if (is("freiburg1", "fr1"))
    camera = {640, 480, 517.3, 516.5, 318.6, 255.3, {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}};
  else if (is("freiburg2", "fr2"))
    camera = {640, 480, 520.9, 521.0, 325.1, 249.7, {0.2312, -0.7849, -0.0033, -0.0001, 0.9172}};
  else if (is("freiburg3", "fr3"))
    camera = {640, 480, 535.4, 539.2, 320.1, 247.6, {}};
  else if (is("rgbd_bonn", "rgbd_bonn"))  // Palazzolo et al. 2019
    camera = {
        640, 480, 542.822841, 542.576870, 315.593520, 237.756098, {0.039903, -0.099343, -0.000730, -0.000144, 0.0}};
  else
    return false;
  return true;
}

/// `fx fy cx cy` of ETH3D's SLAM benchmark (Schöps et al. 2019), whose images have no lens; their size is the first's
/// that can be read.
Camera read_calibration(const fs::path& file, const std::vector<Stamped>& depth) {
  Camera camera;
  int lines = 0;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (++lines > 1 || words.size() != 4)
      throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": expected one line `fx fy cx cy`");
    const auto number = [&](std::size_t i) { return number_of(words[i], file, line); };
    camera.fx = number(0), camera.fy = number(1), camera.cx = number(2), camera.cy = number(3);
  });
  if (lines == 0) throw std::runtime_error(file.string() + ": is empty; expected one line `fx fy cx cy`");
  std::optional<Eigen::Vector2i> size;
  for (std::size_t i = 0; i < depth.size() && !size; ++i) size = size_of_image(depth[i].image);
  if (!size)
    throw std::runtime_error(file.string() + ": no image of depth.txt can be read, so the camera's size is not known");
  camera.width = size->x();
  camera.height = size->y();
  try {
    check(camera);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
  return camera;
}

struct Acceleration {
  double timestamp;
  Eigen::Vector3d value;  // in the camera's frame
};

/// A Kinect's accelerometer has y up and z forward: a half turn about z leads to the camera's frame.
std::vector<Acceleration> read_accelerometer(const fs::path& file) {
  std::vector<Acceleration> samples;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != 4)
      throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": expected `timestamp ax ay az`");
    const auto number = [&](std::size_t i) { return number_of(words[i], file, line); };
    samples.push_back({number(0), {-number(1), -number(2), number(3)}});
  });
  std::stable_sort(samples.begin(), samples.end(),
                   [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
  return samples;
}

std::vector<AngularRate> read_gyroscope(const fs::path& file) {
  std::vector<AngularRate> samples;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != 4)
      throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": expected `timestamp rx ry rz`");
    const auto number = [&](std::size_t i) { return number_of(words[i], file, line); };
    samples.push_back({number(0), {number(1), number(2), number(3)}});
  });
  std::stable_sort(samples.begin(), samples.end(),
                   [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
  return samples;
}

std::optional<Eigen::Vector3d> mean_around(const std::vector<Acceleration>& samples, double timestamp) {
  auto it = std::lower_bound(samples.begin(), samples.end(), timestamp - kAccelerationWindow,
                             [](const Acceleration& a, double t) { return a.timestamp < t; });
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (; it != samples.end() && it->timestamp <= timestamp + kAccelerationWindow; ++it, ++count) sum += it->value;
  if (count == 0) return std::nullopt;
  return sum / count;
}

}  // namespace

std::optional<Recording> read_tum(const fs::path& folder) {
  const bool has_depth = fs::exists(folder / "depth.txt"), has_colour = fs::exists(folder / "rgb.txt");
  if (!has_depth && !has_colour) return std::nullopt;
  if (!has_depth || !has_colour)
    throw std::runtime_error(folder.string() + ": a TUM recording needs both rgb.txt and depth.txt, " +
                             (has_depth ? "rgb.txt" : "depth.txt") + " is missing");
  Recording recording;
  recording.layout = "TUM RGB-D folder";
  const auto depth = read_list(folder / "depth.txt");
  if (fs::exists(folder / "camera.yaml"))
    use(read_camera_file(folder / "camera.yaml"), recording);
  else if (fs::exists(folder / "calibration.txt"))
    recording.layout = "ETH3D folder", recording.rig = read_calibration(folder / "calibration.txt", depth);
  else if (!known_camera(folder, recording.rig.depth))
    throw std::runtime_error(
        folder.string() +
        ": the camera is not known; add camera.yaml with width, height, fx, fy, cx, cy, distortion "
        "[k1, k2, p1, p2, k3] and depth_scale (units per metre), or calibration.txt with fx fy cx cy");
  const auto colour = read_list(folder / "rgb.txt");
  const auto match = associate(depth, colour);
  std::vector<Acceleration> accelerations;
  if (fs::exists(folder / "accelerometer.txt")) accelerations = read_accelerometer(folder / "accelerometer.txt");
  if (fs::exists(folder / "gyroscope.txt")) recording.gyro = read_gyroscope(folder / "gyroscope.txt");
  for (std::size_t i = 0; i < depth.size(); ++i) {
    Recording::Entry entry{.timestamp = depth[i].timestamp, .depth = depth[i].image, .colour = {}, .acceleration = {}};
    if (const auto confidence = folder / "confidence" / depth[i].image.filename(); fs::exists(confidence))
      entry.confidence = confidence;
    entry.acceleration = mean_around(accelerations, entry.timestamp);
    if (match[i] >= 0) {
      const Stamped& image = colour[static_cast<std::size_t>(match[i])];
      entry.colour = image.image;
      entry.colour_delay = image.timestamp - entry.timestamp;
    }
    recording.entries.push_back(std::move(entry));
  }
  if (fs::exists(folder / "groundtruth.txt")) recording.truth = read_trajectory(folder / "groundtruth.txt");
  return recording;
}

}  // namespace cairn
