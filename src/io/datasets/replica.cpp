// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Replica, rendered for iMAP and NICE-SLAM (Sucar et al. 2021, Zhu et al. 2022): results/frame000000.jpg and
// depth000000.png, traj.txt and cam_params.json.
#include <algorithm>
#include <array>
#include <map>
#include <stdexcept>

#include "base/lines.hpp"
#include "base/words.hpp"
#include "geometry/pose_matrix.hpp"
#include "io/camera_file.hpp"
#include "io/datasets/image_names.hpp"
#include "io/json_fields.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kFrameRate = 30.0;        // Hz; the data set has no timestamps
constexpr int kMaxFrameNumber = 10000000;  // upper bound of a number in a name

/// Returns the number in `PREFIX000012`.
std::optional<int> number_of_image(const fs::path& image, std::string_view prefix) {
  const std::string stem = image.stem().string();
  if (!stem.starts_with(prefix)) return std::nullopt;
  const auto number = number_in<int>(std::string_view(stem).substr(prefix.size()));
  return number && *number >= 0 && *number < kMaxFrameNumber ? number : std::nullopt;
}

void read_camera(const nlohmann::json& json, Recording& recording) {
  const auto camera = json.find("camera");
  if (camera == json.end() || !camera->is_object()) throw std::runtime_error("`camera` is missing");
  const auto number = [&](const char* key) { return number_at(*camera, key); };
  recording.rig = Camera{
      pixels_at(*camera, "w"), pixels_at(*camera, "h"), number("fx"), number("fy"), number("cx"), number("cy"), {}};
  check(recording.rig.depth);
  recording.depth_scale = number("scale");
  check_depth_scale(recording.depth_scale);
}

Trajectory read_poses(const fs::path& file) {
  Trajectory poses;
  int index = 0;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    std::array<double, 16> v{};
    if (words.size() != v.size())
      throw std::runtime_error(file.string() + ":" + std::to_string(line) +
                               ": expected the 16 numbers of a 4x4 matrix, row by row");
    for (std::size_t i = 0; i < v.size(); ++i) v[i] = number_of(words[i], file, line);
    const auto pose = pose_of_rows(v);
    if (!pose) throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": is not a pose");
    poses.push_back({index++ / kFrameRate, *pose});
  });
  return poses;
}

}  // namespace

std::optional<Recording> read_replica(const fs::path& folder) {
  const fs::path images = folder / "results";
  if (!fs::is_directory(images)) return std::nullopt;
  fs::path camera = folder / "cam_params.json";
  const bool has_camera = fs::exists(camera);
  if (!has_camera && !fs::exists(folder / "traj.txt") && !fs::exists(images / "depth000000.png")) return std::nullopt;
  if (!has_camera) camera = fs::absolute(folder).lexically_normal() / "../cam_params.json";
  Recording recording;
  recording.layout = "Replica folder";
  recording.frame_rate = kFrameRate;
  if (fs::exists(camera)) {
    recording.camera_file = camera;
    read_json(camera, "`camera` with w, h, fx, fy, cx, cy and scale (depth units per meter)",
              [&](const nlohmann::json& json) { read_camera(json, recording); });
  } else {
    recording.camera_is_missing = true;
    recording.has_depth_scale = false;
    recording.camera_hint =
        "cam_params.json is missing, here and in the parent folder; write {\"camera\": {\"w\", \"h\", \"fx\", \"fy\", "
        "\"cx\", \"cy\", \"scale\"}} into it, or ";
  }
  std::map<int, fs::path> depth, color;
  for (const auto& image : depth_images_in(images))
    if (const auto number = number_of_image(image, "depth")) depth.emplace(*number, image);
  for (const auto& image : images_in(images)) {
    if (const auto number = number_of_image(image, "frame")) color.emplace(*number, image);
  }
  if (depth.empty()) throw std::runtime_error(images.string() + ": has no depth000000.png");
  for (const auto& [number, image] : depth) {
    const auto match = color.find(number);
    recording.entries.push_back({number / kFrameRate, image, match == color.end() ? fs::path() : match->second});
  }
  if (fs::exists(folder / "traj.txt")) recording.truth = read_poses(folder / "traj.txt");
  return recording;
}

}  // namespace cairn
