// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Images exported by RTAB-Map (Labbe & Michaud 2019): rgb/ and depth/, named by timestamp, and the calibration in
// OpenCV's YAML. All names may have the prefix rtabmap_.
#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "base/file_name.hpp"
#include "base/lines.hpp"
#include "base/words.hpp"
#include "geometry/pose_matrix.hpp"
#include "io/datasets/image_names.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"
#include "options/yaml_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct Calibration {
  Camera color;
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();
};

std::vector<double> matrix(const YAML::Node& y, const char* name) {
  const YAML::Node data = y[name].IsMap() ? y[name]["data"] : YAML::Node();
  if (!data) throw std::runtime_error(fmt::format("`{}` is missing, or has no `data`", name));
  return data.as<std::vector<double>>();
}

Calibration calibration_of(const YAML::Node& y) {
  Calibration read;
  read.color = camera_of_ros(y);
  if (!y["local_transform"]) return read;
  const auto local = matrix(y, "local_transform");
  const auto pose = local.size() == 12 ? pose_of_rows(local) : std::nullopt;
  if (!pose) throw std::runtime_error("`local_transform` is not a pose of 3x4 numbers");
  read.base_from_camera = *pose;
  return read;
}

Calibration read_calibration(const fs::path& file) {
  try {
    return calibration_of(read_yaml_file(file));
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(file.string() + ":" + std::to_string(error.mark.line + 1) + ": " + shown(error.msg) +
                             "; expected RTAB-Map's calibration, with image_width, image_height and camera_matrix");
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

/// Returns calibration.yaml, calib.yaml, or the first YAML file of calib/.
fs::path calibration_in(const fs::path& folder, const std::string& prefix) {
  for (const char* name : {"calibration.yaml", "calib.yaml"})
    if (fs::exists(folder / (prefix + name))) return folder / (prefix + name);
  const fs::path calib = folder / (prefix + "calib");
  fs::path first;
  if (fs::is_directory(calib))
    for (const auto& entry : fs::directory_iterator(calib))
      if (extension_of(entry.path()) == ".yaml" && (first.empty() || entry.path() < first)) first = entry.path();
  return first;
}

/// Reads lines `timestamp x y z qx qy qz qw`, optionally with an id: poses of the robot's base.
Trajectory read_poses(const fs::path& file, const Eigen::Isometry3d& base_from_camera) {
  Trajectory poses;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    const auto error = [&](const char* why) {
      return std::runtime_error(file.string() + ":" + std::to_string(line) + ": " + why);
    };
    if (words.size() != 8 && words.size() != 9)
      throw error("expected `timestamp x y z qx qy qz qw`, optionally followed by an id");
    const auto number = [&](std::size_t i) { return number_of(words[i], file, line); };
    const Eigen::Quaterniond q(number(7), number(4), number(5), number(6));
    if (!is_rotation(q)) throw error("the quaternion is zero or too large");
    Eigen::Isometry3d world_from_base = Eigen::Isometry3d::Identity();
    world_from_base.linear() = q.normalized().toRotationMatrix();
    world_from_base.translation() = Eigen::Vector3d(number(1), number(2), number(3));
    poses.push_back({number(0), world_from_base * base_from_camera});
    if (!poses.back().world_from_camera.matrix().allFinite()) throw error("its numbers are too large for a pose");
  });
  std::stable_sort(poses.begin(), poses.end(), [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
  return poses;
}

}  // namespace

std::optional<Recording> read_rtabmap(const fs::path& folder) {
  for (const std::string prefix : {"", "rtabmap_"}) {
    const fs::path images = folder / (prefix + "depth");
    const fs::path file = calibration_in(folder, prefix);
    const auto all = depth_images_in(images);
    const auto is_time = [](const fs::path& image) { return number_in(image.stem().string()).has_value(); };
    if (file.empty() || (!all.empty() && std::none_of(all.begin(), all.end(), is_time)) || !fs::is_directory(images) ||
        !fs::is_directory(folder / (prefix + "rgb")))
      continue;
    const Calibration calibration = read_calibration(file);
    Recording recording;
    recording.layout = "RTAB-Map folder";
    recording.has_device_poses = true;
    recording.depth_scale = 1000;
    recording.camera_file = file;
    std::map<std::string, fs::path> color;
    for (const auto& image : images_in(folder / (prefix + "rgb"))) color.emplace(image.stem().string(), image);
    for (const auto& depth : all) {
      const std::string stem = depth.stem().string();
      const auto time = number_in(stem);
      if (!time || !std::isfinite(*time))
        throw std::runtime_error(depth.string() +
                                 ": its name is not a timestamp; export images with timestamps as names");
      const auto match = color.find(stem);
      recording.entries.push_back({*time, depth, match == color.end() ? fs::path() : match->second});
    }
    if (recording.entries.empty()) throw std::runtime_error(images.string() + ": has no PNG image");
    std::stable_sort(recording.entries.begin(), recording.entries.end(),
                     [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
    set_registered_rig(calibration.color, recording);
    const fs::path poses = folder / (prefix + "poses.txt");
    if (fs::exists(poses)) recording.truth = read_poses(poses, calibration.base_from_camera);
    return recording;
  }
  return std::nullopt;
}

}  // namespace cairn
