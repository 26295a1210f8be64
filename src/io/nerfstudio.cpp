// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// nerfstudio's transforms.json (Tancik et al. 2023) with depth images. Poses use the OpenGL camera: x right, y up, z
// back. The center of the upper left pixel is (0.5, 0.5).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <stdexcept>
#include <string_view>
#include <tuple>

#include "base/words.hpp"
#include "cairn/file_name.hpp"
#include "io/camera_file.hpp"
#include "io/json_fields.hpp"
#include "io/pose_matrix.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;
constexpr std::array kColorEndings{".png"sv, ".jpg"sv, ".jpeg"sv, ".JPG"sv, ".PNG"sv, ".JPEG"sv};
constexpr std::array kDepthEndings{".png"sv, ".npy"sv, ".exr"sv, ".tiff"sv, ".tif"sv};
constexpr double kFrameRate = 30.0;  // Hz; frames have no timestamps
constexpr const char* kExpected =
    "`frames` with file_path, depth_file_path and transform_matrix, and fl_x, fl_y, cx, cy, w and h";

/// Returns the frame if it has the key, else the top-level object.
const nlohmann::json& holder(const nlohmann::json& frame, const nlohmann::json& all, const char* key) {
  return frame.contains(key) ? frame : all;
}

std::string text_at(const nlohmann::json& object, const char* key) {
  const auto it = object.find(key);
  if (it == object.end()) throw std::runtime_error(fmt::format("`{}` is missing", key));
  if (!it->is_string()) throw std::runtime_error(fmt::format("`{}` is not a text", key));
  return it->get<std::string>();
}

/// Resolves a file named in `transforms.json`, also with Windows separators or without extension; empty if missing.
fs::path file_named(const fs::path& folder, std::string name, std::span<const std::string_view> endings) {
  std::error_code ignored;
  if (fs::exists(folder / name, ignored)) return folder / name;
  std::replace(name.begin(), name.end(), '\\', '/');
  if (fs::exists(folder / name, ignored)) return folder / name;
  for (const std::string_view ending : endings)
    if (fs::path file = folder / name; fs::exists(file += ending, ignored)) return file;
  return {};
}

/// The same, but returns the expected path if the file is missing.
fs::path place_named(const fs::path& folder, std::string name, std::span<const std::string_view> endings) {
  if (fs::path file = file_named(folder, name, endings); !file.empty()) return file;
  std::replace(name.begin(), name.end(), '\\', '/');
  return folder / name;
}

/// Reads the lens, from nerfstudio's names of COLMAP's camera models.
void take_lens(const nlohmann::json& frame, const nlohmann::json& all, Camera& c) {
  const nlohmann::json& says = holder(frame, all, "camera_model");
  const auto is_fisheye = all.find("is_fisheye");  // instant-ngp's key
  std::string model = "OPENCV";
  if (says.contains("camera_model"))
    model = text_at(says, "camera_model");
  else if (is_fisheye != all.end() && is_fisheye->is_boolean() && is_fisheye->get<bool>())
    model = "OPENCV_FISHEYE";
  const auto d = [&](const char* key) { return number_at(holder(frame, all, key), key, 0.0); };
  constexpr std::array kBrown{"OPENCV"sv, "PINHOLE"sv, "SIMPLE_PINHOLE"sv, "SIMPLE_RADIAL"sv, "RADIAL"sv};
  if (model == "OPENCV_FISHEYE") {
    c.lens = Lens::fisheye;
    c.distortion = {d("k1"), d("k2"), d("k3"), d("k4")};
  } else if (std::find(kBrown.begin(), kBrown.end(), model) != kBrown.end()) {
    // Nerfstudio's k4 is the next power of the radius, unsupported by the Brown-Conrady model used here.
    if (d("k4") != 0) throw std::runtime_error("`k4` is not 0, which only camera_model OPENCV_FISHEYE may have");
    c.distortion = {d("k1"), d("k2"), d("p1"), d("p2"), d("k3")};
  } else {
    throw std::runtime_error(
        fmt::format("`camera_model` is '{}', known are OPENCV, OPENCV_FISHEYE and PINHOLE", shown(model)));
  }
}

/// `size`: image size, used if missing from the file.
Camera camera_of(const nlohmann::json& frame, const nlohmann::json& all, const Eigen::Vector2i& size) {
  const auto has = [&](const char* key) { return holder(frame, all, key).contains(key); };
  const auto number = [&](const char* key, std::optional<double> usual = {}) {
    return number_at(holder(frame, all, key), key, usual);
  };
  const auto pixels = [&](const char* key, int usual) {
    return usual > 0 && !has(key) ? usual : pixels_at(holder(frame, all, key), key);
  };
  Camera c{.width = pixels("w", size.x()), .height = pixels("h", size.y())};
  const auto focal = [&](const char* key, const char* angle, int side, std::optional<double> usual) {
    if (!has(key) && has(angle)) usual = 0.5 * side / std::tan(0.5 * number(angle));  // Blender's convention
    return number(key, usual);
  };
  c.fx = focal("fl_x", "camera_angle_x", c.width, {});
  c.fy = focal("fl_y", "camera_angle_y", c.height, c.fx);
  c.cx = number("cx", 0.5 * c.width) - 0.5;
  c.cy = number("cy", 0.5 * c.height) - 0.5;
  take_lens(frame, all, c);
  check(c);
  return c;
}

Eigen::Isometry3d pose_in(const nlohmann::json& frame) {
  const auto it = frame.find("transform_matrix");
  std::vector<double> rows;
  if (it != frame.end() && it->is_array())
    for (const auto& row : *it)
      if (row.is_array())
        for (const auto& number : row)
          if (number.is_number()) rows.push_back(number.get<double>());
  const auto pose = rows.size() == 16 ? pose_of_rows(rows) : std::nullopt;
  if (!pose) throw std::runtime_error("`transform_matrix` is no pose of 4x4 numbers");
  return *pose * opengl_from_camera();
}

struct Shot {
  fs::path depth, color;
  Camera camera;
  Eigen::Isometry3d world_from_camera;
};

/// Meters per unit of the poses: nerfstudio scales poses, but not depth, by `applied_scale`, or within
/// `applied_transform`.
double meters_of_poses(const nlohmann::json& all) {
  double scale = number_at(all, "applied_scale", 1.0);
  if (const auto it = all.find("applied_transform"); it != all.end() && it->is_array() && it->size() >= 3) {
    Eigen::Matrix3d turn;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) turn(r, c) = it->at(static_cast<std::size_t>(r)).at(static_cast<std::size_t>(c));
    scale *= std::cbrt(std::abs(turn.determinant()));
  }
  if (!(scale > 1e-6 && scale < 1e6)) throw std::runtime_error("`applied_scale` and `applied_transform` tell no scale");
  return std::abs(scale - 1) < 1e-6 ? 1 : 1 / scale;
}

/// Depth file of a frame: the named file, else a file in depth/ with the color image's name; empty if there is none.
fs::path depth_of(const nlohmann::json& frame, const fs::path& folder) {
  for (const char* key : {"depth_file_path", "depth_path"})
    if (frame.contains(key) && !frame[key].is_null()) return place_named(folder, text_at(frame, key), kDepthEndings);
  if (!frame.contains("file_path")) return {};
  std::string name = text_at(frame, "file_path");
  std::replace(name.begin(), name.end(), '\\', '/');
  const std::string stem = fs::path(name).stem().string();
  if (stem.empty()) return {};
  for (const char* below : {"depth", "depths"})
    if (fs::path file = file_named(folder, (fs::path(below) / stem).string(), kDepthEndings); !file.empty())
      return file;
  return {};
}

/// Reads a frame, with its pose in meters.
Shot shot_of(const nlohmann::json& frame, const nlohmann::json& all, const fs::path& folder, double meters,
             Eigen::Vector2i& size) {
  Shot shot;
  shot.depth = depth_of(frame, folder);
  if (shot.depth.empty()) return shot;
  if (frame.contains("file_path")) shot.color = place_named(folder, text_at(frame, "file_path"), kColorEndings);
  const auto tells = [&](const char* key) { return holder(frame, all, key).contains(key); };
  if (size.x() == 0 && !(tells("w") && tells("h")))
    size = size_of_image(shot.color).value_or(size_of_image(shot.depth).value_or(Eigen::Vector2i(0, 0)));
  shot.camera = camera_of(frame, all, size);
  shot.world_from_camera = pose_in(frame);
  shot.world_from_camera.translation() *= meters;
  return shot;
}

/// Frames with depth, in capture order: frame_2 comes before frame_10. Structure from motion stores them in another
/// order.
std::vector<Shot> shots_in(const nlohmann::json& all, const fs::path& folder) {
  const auto frames = all.find("frames");
  if (frames == all.end() || !frames->is_array() || frames->empty())
    throw std::runtime_error("`frames` is missing or empty");
  const double meters = meters_of_poses(all);
  std::vector<Shot> shots;
  Eigen::Vector2i size(0, 0);
  for (std::size_t i = 0; i < frames->size(); ++i) {
    try {
      if (!(*frames)[i].is_object()) throw std::runtime_error("is no JSON object");
      Shot shot = shot_of((*frames)[i], all, folder, meters, size);
      if (!shot.depth.empty()) shots.push_back(std::move(shot));
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(fmt::format("frame {}: {}", i, error.what()));
    }
  }
  std::stable_sort(shots.begin(), shots.end(), [](const Shot& a, const Shot& b) {
    const std::string &x = a.depth.native(), &y = b.depth.native();
    return std::tuple(x.size(), std::string_view(x)) < std::tuple(y.size(), std::string_view(y));
  });
  return shots;
}

void read_frames(const nlohmann::json& json, const fs::path& folder, Recording& recording,
                 std::vector<Camera>& cameras) {
  const auto shots = shots_in(json, folder);
  const std::size_t all = json["frames"].size();
  if (shots.empty())
    throw std::runtime_error(fmt::format(
        "none of its {} frames has depth (depth_file_path): color images alone make no map here; export depth, too (of "
        "Polycam: the raw data, or ns-process-data polycam --use-depth)",
        all));
  if (shots.size() < all)
    recording.warnings.push_back(
        fmt::format("{} of {} frames have no depth (depth_file_path) and are left out", all - shots.size(), all));
  for (const Shot& shot : shots) {
    const double time = static_cast<double>(recording.entries.size()) / kFrameRate;
    recording.entries.push_back({time, shot.depth, shot.color});
    recording.truth.push_back({time, shot.world_from_camera});
    cameras.push_back(shot.camera);
  }
}

/// Depth units per meter, by nerfstudio's key or instant-ngp's. Without a key, OpenEXR holds meters.
double depth_scale_of(const nlohmann::json& all, const Recording& recording) {
  for (const char* key : {"depth_unit_scale_factor", "integer_depth_scale"}) {
    if (!all.contains(key)) continue;
    const double meters = number_at(all, key);
    if (!(meters > 0)) throw std::runtime_error(fmt::format("`{}` takes metres per unit, more than 0", key));
    check_depth_scale(1 / meters);
    return 1 / meters;
  }
  return extension_of(recording.entries[0].depth) == ".exr" ? 1 : 1000;
}

}  // namespace

std::optional<Recording> read_nerfstudio(const fs::path& folder) {
  const fs::path file = folder / "transforms.json";
  if (!fs::exists(file)) return std::nullopt;
  Recording recording;
  recording.layout = "nerfstudio folder";
  recording.has_device_poses = true;
  recording.camera_file = file;
  recording.frame_rate = kFrameRate;
  std::vector<Camera> cameras;
  read_json(file, kExpected, [&](const nlohmann::json& json) {
    read_frames(json, folder, recording, cameras);
    recording.depth_scale = depth_scale_of(json, recording);
  });
  set_cameras_of_frames(cameras, recording);
  return recording;
}

}  // namespace cairn
