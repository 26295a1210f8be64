// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Record3D exports (iPhones and iPads) as EXR and JPG: depth in meters and color, named by frame number, and
// metadata.json. Poses are ARKit's: world y up, camera axes as in OpenGL.
#include "io/datasets/record3d.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/file_name.hpp"
#include "base/words.hpp"
#include "geometry/pose_matrix.hpp"
#include "io/datasets/image_names.hpp"
#include "io/json_fields.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
constexpr double kFrameRate = 60;  // Hz, without times and `fps`
constexpr int kTrueDepth = 0;      // `cameraType` of the front camera; the rear camera is LiDAR
constexpr const char* kExpected = "Record3D's metadata with K, w, h, and frameTimestamps and poses";

/// Returns the first `count` numbers of a list; empty if the list is shorter or has other types.
std::optional<std::vector<double>> numbers_in(const Json& list, std::size_t count) {
  if (!list.is_array() || list.size() < count) return std::nullopt;
  std::vector<double> numbers;
  for (std::size_t i = 0; i < count; ++i) {
    if (!list[i].is_number()) return std::nullopt;
    numbers.push_back(list[i].get<double>());
  }
  return numbers;
}

/// The same for a frame's entry in the list `key`.
std::optional<std::vector<double>> numbers_of(const Json& all, const char* key, std::size_t frame, std::size_t count) {
  const auto it = all.find(key);
  return it != all.end() && it->is_array() && frame < it->size() ? numbers_in((*it)[frame], count) : std::nullopt;
}

/// Time of a frame, seconds.
double time_of(const Json& all, std::size_t index, double rate) {
  const auto times = all.find("frameTimestamps");
  if (times == all.end() || !times->is_array() || index >= times->size() || !(*times)[index].is_number())
    return static_cast<double>(index) / rate;
  return (*times)[index].get<double>();
}

/// Pose world_from_camera of a frame, from qx qy qz qw and the translation.
std::optional<Eigen::Isometry3d> pose_of(const Json& all, std::size_t index) {
  const auto v = numbers_of(all, "poses", index, 7);
  if (!v) return std::nullopt;
  const Eigen::Quaterniond q((*v)[3], (*v)[0], (*v)[1], (*v)[2]);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (!is_rotation(q)) return std::nullopt;
  pose.linear() = q.normalized().toRotationMatrix();
  pose.translation() = Eigen::Vector3d((*v)[4], (*v)[5], (*v)[6]);
  if (!pose.matrix().allFinite()) return std::nullopt;
  return pose * opengl_from_camera();
}

/// Camera of a frame, from perFrameIntrinsicCoeffs (fx fy cx cy) if present.
Camera camera_of(const Json& all, std::size_t index, const Camera& fallback) {
  Camera camera = fallback;
  if (const auto c = numbers_of(all, "perFrameIntrinsicCoeffs", index, 4); c && (*c)[0] > 0) {
    camera.fx = (*c)[0], camera.fy = (*c)[1], camera.cx = (*c)[2], camera.cy = (*c)[3];
    check(camera);
  }
  return camera;
}

/// Throws for an unpacked .r3d archive, whose depth is compressed.
void reject_compressed_depth(const fs::path& folder) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder / "rgbd", ignored))
    if (extension_of(entry.path()) == ".depth") throw std::runtime_error(r3d_advice(folder));
}

/// Maps the numbers in image names to the images.
std::map<std::size_t, fs::path> by_number(const std::vector<fs::path>& images) {
  std::map<std::size_t, fs::path> all;
  for (const fs::path& image : images)
    if (const auto number = number_in<std::uint32_t>(image.stem().string())) all.emplace(*number, image);
  return all;
}

void read_frames(const Json& all, const fs::path& folder, Recording& recording, std::vector<Camera>& cameras) {
  const auto depth = by_number(depth_images_in(folder / "depth")), color = by_number(images_in(folder / "rgb"));
  if (depth.empty())
    throw std::runtime_error(
        "its folder depth has no image NUMBER.exr: export again in the app as EXR + JPG; devices without LiDAR or "
        "TrueDepth have no depth");
  const double rate = number_at(all, "fps", kFrameRate);
  if (!(rate > 0 && rate <= 1000)) throw std::runtime_error(fmt::format("`fps` is {}", rate));
  Camera fallback = camera_of_record3d(all);
  std::vector<std::pair<std::size_t, fs::path>> ordered(depth.begin(), depth.end());
  std::stable_sort(ordered.begin(), ordered.end(), [&](const auto& a, const auto& b) {
    return time_of(all, a.first, rate) < time_of(all, b.first, rate);
  });
  for (const auto& [number, file] : ordered) {
    Recording::Entry entry{.timestamp = time_of(all, number, rate), .depth = file};
    if (const auto it = color.find(number); it != color.end()) entry.color = it->second;
    if (const auto pose = pose_of(all, number)) recording.truth.push_back({entry.timestamp, *pose});
    cameras.push_back(camera_of(all, number, fallback));
    recording.entries.push_back(std::move(entry));
  }
  // The images may be smaller than at export.
  std::optional<Eigen::Vector2i> size;
  for (auto it = color.begin(); it != color.end() && !size; ++it) size = size_of_image(it->second);
  for (auto it = depth.begin(); it != depth.end() && !size; ++it) size = size_of_image(it->second);
  if (size)
    for (Camera& camera : cameras) camera = scaled_to(camera, *size);
  recording.depth_scale = extension_of(depth.begin()->second) == ".png" ? 1000 : 1;
}

}  // namespace

bool is_record3d(const Json& all) {
  return all.is_object() && all.contains("K") && all.contains("w") && all.contains("h") &&
         (all.contains("poses") || all.contains("frameTimestamps"));
}

Camera camera_of_record3d(const Json& all) {
  auto k = numbers_in(all.at("K"), 9);
  if (k && (*k)[6] == 0 && (*k)[7] == 0) std::swap((*k)[2], (*k)[6]), std::swap((*k)[5], (*k)[7]);  // row-major
  if (!k || (*k)[8] != 1 || (*k)[2] != 0 || (*k)[5] != 0)
    throw std::runtime_error("`K` is not [fx, 0, 0, 0, fy, 0, cx, cy, 1]");
  Camera camera{.width = pixels_at(all, "w"),
                .height = pixels_at(all, "h"),
                .fx = (*k)[0],
                .fy = (*k)[4],
                .cx = (*k)[6],
                .cy = (*k)[7]};
  check(camera);
  return camera;
}

std::string r3d_advice(const fs::path& archive) {
  return fmt::format(
      "{}: is Record3D's own archive, whose depth is compressed with LZFSE, which is not supported: export the "
      "recording in the "
      "app as EXR + JPG and give the folder with rgb, depth and metadata.json",
      archive.string());
}

std::optional<Recording> read_record3d(const fs::path& folder) {
  fs::path file = folder / "metadata.json";
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) file = folder / "metadata";
  if (!fs::is_regular_file(file, ignored)) return std::nullopt;
  Recording recording;
  std::vector<Camera> cameras;
  bool is_record3d_file = false;
  // Other programs use this file name too.
  const auto bytes = read_whole(file);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const char* key : {"\"K\"", "\"w\"", "\"h\""})
    if (text.find(key) == text.npos) return std::nullopt;
  reject_compressed_depth(folder);
  read_json(file, kExpected, [&](const Json& all) {
    is_record3d_file = is_record3d(all);
    if (!is_record3d_file) return;
    read_frames(all, folder, recording, cameras);
    const bool is_lidar = number_at(all, "cameraType", kTrueDepth + 1) != kTrueDepth;
    if (is_lidar) recording.rig.sensor = sensor_model("phone_lidar");
  });
  if (!is_record3d_file) return std::nullopt;
  recording.layout = "Record3D folder";
  recording.has_device_poses = true;
  recording.camera_file = file;
  const SensorModel sensor = recording.rig.sensor;
  set_frame_cameras(cameras, recording);
  recording.rig.sensor = sensor;
  return recording;
}

}  // namespace cairn
