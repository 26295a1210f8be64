// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Polycam raw data (iPhones and iPads with LiDAR): keyframes, each with its own camera. Poses are ARKit's, or from
// Polycam's bundle adjustment (`corrected`).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <stdexcept>

#include "base/words.hpp"
#include "geometry/pose_matrix.hpp"
#include "io/datasets/image_names.hpp"
#include "io/json_fields.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kCameraExtension = ".json";
constexpr double kMicroseconds = 1e-6;  // seconds per unit of the numbers in frame names
constexpr double kFrameRate = 4;        // Hz, for keyframes without times as names
constexpr const char* kExpected = "Polycam's camera with fx, fy, cx, cy, width, height and t_00 to t_23";

constexpr double kMaxConfidence = 108;  // of levels 0, 54 and 255; maps the middle level to ARKit's, 128 of 255

struct Folders {
  fs::path cameras, color, depth;
};

std::vector<fs::path> cameras_in(const fs::path& folder) { return files_in(folder, std::array{kCameraExtension}); }

bool is_camera(const fs::path& file) {
  const auto bytes = read_whole(file);
  return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()).find("\"t_00\"") !=
         std::string_view::npos;
}

/// Returns the folders with the app's adjusted poses if present, after checking a camera file, because other programs
/// use these folder names too.
std::optional<Folders> folders_in(const fs::path& keyframes) {
  std::error_code ignored;
  for (const std::string prefix : {"corrected_", ""}) {
    const auto named = [&](const char* name) {
      const fs::path adjusted = keyframes / (prefix + name);
      return fs::is_directory(adjusted, ignored) ? adjusted : keyframes / name;
    };
    const fs::path cameras = keyframes / (prefix + "cameras");
    if (const auto files = cameras_in(cameras); !files.empty() && is_camera(files[0]))
      return Folders{cameras, named("images"), named("depth")};
  }
  return std::nullopt;
}

std::map<std::string, fs::path> by_stem(const std::vector<fs::path>& files) {
  std::map<std::string, fs::path> all;
  for (const fs::path& file : files) all.emplace(file.stem().string(), file);
  return all;
}

fs::path find(const std::map<std::string, fs::path>& files, const std::string& stem) {
  const auto it = files.find(stem);
  return it == files.end() ? fs::path() : it->second;
}

struct Keyframe {
  Camera camera;
  Eigen::Isometry3d world_from_camera;
};

Keyframe read_keyframe(const fs::path& file) {
  Keyframe read;
  read_json(file, kExpected, [&](const nlohmann::json& json) {
    const auto number = [&](const std::string& key) { return number_at(json, key.c_str()); };
    read.camera = {.width = pixels_at(json, "width"),
                   .height = pixels_at(json, "height"),
                   .fx = number("fx"),
                   .fy = number("fy"),
                   .cx = number("cx"),
                   .cy = number("cy")};
    check(read.camera);
    std::vector<double> rows;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) rows.push_back(number(fmt::format("t_{}{}", r, c)));
    const auto pose = pose_of_rows(rows);
    if (!pose) throw std::runtime_error("`t_00` to `t_23` are not a pose");
    read.world_from_camera = *pose * opengl_from_camera();
  });
  return read;
}

/// Adds the keyframes with depth, sorted by name; returns the number of keyframes without depth.
int add_keyframes(const Folders& folders, const fs::path& keyframes, Recording& recording,
                  std::vector<Camera>& cameras) {
  const auto depth = by_stem(depth_images_in(folders.depth)), color = by_stem(images_in(folders.color)),
             confidence = by_stem(images_in(keyframes / "confidence"));
  const auto files = cameras_in(folders.cameras);
  const bool are_times = std::all_of(files.begin(), files.end(), [](const fs::path& f) {
    return number_in<std::uint64_t>(f.stem().string()) > 1'000'000u;
  });
  int skipped = 0;
  for (const fs::path& file : files) {
    const std::string stem = file.stem().string();
    const fs::path image = find(depth, stem);
    if (image.empty()) {
      ++skipped;
      continue;
    }
    const Keyframe keyframe = read_keyframe(file);
    const double time = are_times ? kMicroseconds * static_cast<double>(*number_in<std::uint64_t>(stem))
                                  : static_cast<double>(recording.entries.size()) / kFrameRate;
    recording.entries.push_back(
        {.timestamp = time, .depth = image, .color = find(color, stem), .confidence = find(confidence, stem)});
    recording.truth.push_back({time, keyframe.world_from_camera});
    cameras.push_back(keyframe.camera);
  }
  return skipped;
}

}  // namespace

std::optional<Recording> read_polycam(const fs::path& folder) {
  std::error_code ignored;
  const fs::path keyframes = fs::is_directory(folder / "keyframes", ignored) ? folder / "keyframes" : folder;
  const auto folders = folders_in(keyframes);
  if (!folders) return std::nullopt;
  Recording recording;
  recording.layout = "Polycam folder";
  recording.has_device_poses = true;
  recording.depth_scale = 1000;
  recording.max_confidence = kMaxConfidence;
  std::vector<Camera> cameras;
  const int skipped = add_keyframes(*folders, keyframes, recording, cameras);
  if (cameras.empty())
    throw std::runtime_error(
        fmt::format("{}: has no depth image named as a camera in {}: photo mode stores none; capture in LiDAR or Space "
                    "mode and export the raw data (developer mode in the app's settings)",
                    folders->depth.string(), folders->cameras.string()));
  if (skipped > 0)
    recording.warnings.push_back(fmt::format("{} of {} keyframes have no depth image and are skipped", skipped,
                                             skipped + static_cast<int>(cameras.size())));
  set_frame_cameras(cameras, recording);
  recording.rig.sensor = sensor_model("phone_lidar");
  recording.interpretations.push_back({"poses", folders->cameras.string()});
  return recording;
}

}  // namespace cairn
