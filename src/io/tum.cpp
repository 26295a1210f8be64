// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// TUM RGB-D benchmark (Sturm et al. 2012): rgb.txt and depth.txt list images with their times.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "base/lines.hpp"
#include "cairn/file_name.hpp"
#include "cairn/known_cameras.hpp"
#include "io/image_names.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kAccelerationWindow = 0.25;  // seconds around a frame, so that the hand's shaking averages out
constexpr double kMaxTimeDifference = 0.02;   // seconds between a depth image and its colour image

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

/// Calibrations published with the benchmark, by what the folder's name holds.
const KnownCamera* known_by_name(const fs::path& folder) {
  const std::string name = fs::weakly_canonical(folder).filename().string();
  for (const auto& [part, camera] : {std::pair{"freiburg1", "freiburg1"},
                                     {"fr1", "freiburg1"},
                                     {"freiburg2", "freiburg2"},
                                     {"fr2", "freiburg2"},
                                     {"freiburg3", "freiburg3"},
                                     {"fr3", "freiburg3"},
                                     {"rgbd_bonn", "bonn"}})
    if (name.find(part) != name.npos) return known_camera(camera);
  return nullptr;
}

/// That of the first image that can be read.
void take_size(const fs::path& file, const std::vector<Stamped>& depth, Camera& camera) {
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
}

/// For each depth image its colour image, or -1.
std::vector<int> pair_by_time(const std::vector<Stamped>& depth, const std::vector<Stamped>& colour,
                              const fs::path& file) {
  const auto times_of = [](const std::vector<Stamped>& list) {
    std::vector<double> times;
    times.reserve(list.size());
    for (const Stamped& stamped : list) times.push_back(stamped.timestamp);
    return times;
  };
  try {
    return associate(times_of(depth), times_of(colour), kMaxTimeDifference);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
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
  take_size(file, depth, camera);
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
  recording.unit_is_told = false;  // unless camera.yaml does
  if (fs::exists(folder / "calibration.txt") && !fs::exists(folder / "camera.yaml")) {
    recording.layout = "ETH3D folder", recording.rig = read_calibration(folder / "calibration.txt", depth);
  } else if (const auto file = intrinsics_file(folder)) {
    const CameraFile camera = read_intrinsics(*file).camera;
    recording.rig = camera.rig;
    recording.unit_is_told = camera.depth_scale.has_value();
    recording.depth_scale = camera.depth_scale.value_or(recording.depth_scale);
    if (!camera.has_size && extension_of(*file) != ".yaml") take_size(*file, depth, recording.rig.depth);
    recording.understood.push_back({"camera of", file->string()});
  } else if (const KnownCamera* known = known_by_name(folder)) {
    recording.rig = known->camera;
    recording.understood.push_back({"camera of", fmt::format("{}, by the folder's name", known->of)});
  } else {
    recording.camera_missing = folder;
  }
  const auto colour = read_list(folder / "rgb.txt");
  const auto match = pair_by_time(depth, colour, folder / "rgb.txt");
  const auto paired = std::count_if(match.begin(), match.end(), [](int c) { return c >= 0; });
  recording.understood.push_back(
      {"pairing",
       fmt::format(
           "by the times in rgb.txt and depth.txt, within {:.0f} ms; {} depth and {} colour images have no partner",
           1000 * kMaxTimeDifference, static_cast<std::ptrdiff_t>(depth.size()) - paired,
           static_cast<std::ptrdiff_t>(colour.size()) - paired)});
  std::vector<Acceleration> accelerations;
  if (fs::exists(folder / "accelerometer.txt")) accelerations = read_accelerometer(folder / "accelerometer.txt");
  if (fs::exists(folder / "gyroscope.txt")) recording.gyro = read_gyroscope(folder / "gyroscope.txt");
  for (std::size_t i = 0; i < depth.size(); ++i) {
    Recording::Entry entry{.timestamp = depth[i].timestamp, .depth = depth[i].image, .colour = {}, .acceleration = {}};
    std::error_code ignored;  // a name that no file system takes names no file here; the depth image says so
    if (const auto confidence = folder / "confidence" / depth[i].image.filename(); fs::exists(confidence, ignored))
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
