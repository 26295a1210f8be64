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

#include "base/file_name.hpp"
#include "base/words.hpp"
#include "geometry/pose_matrix.hpp"
#include "io/camera_file.hpp"
#include "io/json_fields.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;
constexpr std::array kColorExtensions{".png"sv, ".jpg"sv, ".jpeg"sv, ".JPG"sv, ".PNG"sv, ".JPEG"sv};
constexpr std::array kDepthExtensions{".png"sv, ".npy"sv, ".exr"sv, ".tiff"sv, ".tif"sv};
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
  if (!it->is_string()) throw std::runtime_error(fmt::format("`{}` is not a string", key));
  return it->get<std::string>();
}

/// Resolves a file named in `transforms.json`, also with Windows separators or without extension; empty if missing.
fs::path file_named(const fs::path& folder, std::string name, std::span<const std::string_view> extensions) {
  std::error_code ignored;
  if (fs::exists(folder / name, ignored)) return folder / name;
  std::replace(name.begin(), name.end(), '\\', '/');
  if (fs::exists(folder / name, ignored)) return folder / name;
  for (const std::string_view extension : extensions)
    if (fs::path file = folder / name; fs::exists(file += extension, ignored)) return file;
  return {};
}

/// The same, but returns the expected path if the file is missing.
fs::path expected_path(const fs::path& folder, std::string name, std::span<const std::string_view> extensions) {
  if (fs::path file = file_named(folder, name, extensions); !file.empty()) return file;
  std::replace(name.begin(), name.end(), '\\', '/');
  return folder / name;
}

/// Reads the lens, from nerfstudio's names of COLMAP's camera models.
void set_lens(const nlohmann::json& frame, const nlohmann::json& all, Camera& c) {
  const nlohmann::json& model_holder = holder(frame, all, "camera_model");
  const auto is_fisheye = all.find("is_fisheye");  // instant-ngp's key
  std::string model = "OPENCV";
  if (model_holder.contains("camera_model"))
    model = text_at(model_holder, "camera_model");
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
        fmt::format("`camera_model` is '{}', expected OPENCV, OPENCV_FISHEYE or PINHOLE", shown(model)));
  }
}

/// `size`: image size, used if missing from the file.
Camera camera_of(const nlohmann::json& frame, const nlohmann::json& all, const Eigen::Vector2i& size) {
  const auto has = [&](const char* key) { return holder(frame, all, key).contains(key); };
  const auto number = [&](const char* key, std::optional<double> fallback = {}) {
    return number_at(holder(frame, all, key), key, fallback);
  };
  const auto pixels = [&](const char* key, int fallback) {
    return fallback > 0 && !has(key) ? fallback : pixels_at(holder(frame, all, key), key);
  };
  Camera c{.width = pixels("w", size.x()), .height = pixels("h", size.y())};
  const auto focal = [&](const char* key, const char* angle, int side, std::optional<double> fallback) {
    if (!has(key) && has(angle)) fallback = 0.5 * side / std::tan(0.5 * number(angle));  // Blender's convention
    return number(key, fallback);
  };
  c.fx = focal("fl_x", "camera_angle_x", c.width, {});
  c.fy = focal("fl_y", "camera_angle_y", c.height, c.fx);
  c.cx = number("cx", 0.5 * c.width) - 0.5;
  c.cy = number("cy", 0.5 * c.height) - 0.5;
  set_lens(frame, all, c);
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
  if (!pose) throw std::runtime_error("`transform_matrix` is not a pose of 4x4 numbers");
  return *pose * opengl_from_camera();
}

struct PosedImage {
  fs::path depth, color;
  Camera camera;
  Eigen::Isometry3d world_from_camera;
};

/// Meters per unit of the poses: nerfstudio scales poses, but not depth, by `applied_scale`, or within
/// `applied_transform`.
double meters_of_poses(const nlohmann::json& all) {
  double scale = number_at(all, "applied_scale", 1.0);
  if (const auto it = all.find("applied_transform"); it != all.end() && it->is_array() && it->size() >= 3) {
    Eigen::Matrix3d linear;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) linear(r, c) = it->at(static_cast<std::size_t>(r)).at(static_cast<std::size_t>(c));
    scale *= std::cbrt(std::abs(linear.determinant()));
  }
  if (!(scale > 1e-6 && scale < 1e6))
    throw std::runtime_error("`applied_scale` and `applied_transform` have no valid scale");
  return std::abs(scale - 1) < 1e-6 ? 1 : 1 / scale;
}

/// Depth file of a frame: the named file, else a file in depth/ with the color image's name; empty if there is none.
fs::path depth_of(const nlohmann::json& frame, const fs::path& folder) {
  for (const char* key : {"depth_file_path", "depth_path"})
    if (frame.contains(key) && !frame[key].is_null())
      return expected_path(folder, text_at(frame, key), kDepthExtensions);
  if (!frame.contains("file_path")) return {};
  std::string name = text_at(frame, "file_path");
  std::replace(name.begin(), name.end(), '\\', '/');
  const std::string stem = fs::path(name).stem().string();
  if (stem.empty()) return {};
  for (const char* below : {"depth", "depths"})
    if (fs::path file = file_named(folder, (fs::path(below) / stem).string(), kDepthExtensions); !file.empty())
      return file;
  return {};
}

/// Reads a frame, with its pose in meters.
PosedImage read_image(const nlohmann::json& frame, const nlohmann::json& all, const fs::path& folder, double meters,
                      Eigen::Vector2i& size) {
  PosedImage image;
  image.depth = depth_of(frame, folder);
  if (image.depth.empty()) return image;
  if (frame.contains("file_path")) image.color = expected_path(folder, text_at(frame, "file_path"), kColorExtensions);
  const auto has = [&](const char* key) { return holder(frame, all, key).contains(key); };
  if (size.x() == 0 && !(has("w") && has("h")))
    size = size_of_image(image.color).value_or(size_of_image(image.depth).value_or(Eigen::Vector2i(0, 0)));
  image.camera = camera_of(frame, all, size);
  image.world_from_camera = pose_in(frame);
  image.world_from_camera.translation() *= meters;
  return image;
}

/// Frames with depth, in capture order: frame_2 comes before frame_10. Structure from motion stores them in another
/// order.
std::vector<PosedImage> read_images(const nlohmann::json& all, const fs::path& folder) {
  const auto frames = all.find("frames");
  if (frames == all.end() || !frames->is_array() || frames->empty())
    throw std::runtime_error("`frames` is missing or empty");
  const double meters = meters_of_poses(all);
  std::vector<PosedImage> images;
  Eigen::Vector2i size(0, 0);
  for (std::size_t i = 0; i < frames->size(); ++i) {
    try {
      if (!(*frames)[i].is_object()) throw std::runtime_error("is not a JSON object");
      PosedImage image = read_image((*frames)[i], all, folder, meters, size);
      if (!image.depth.empty()) images.push_back(std::move(image));
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(fmt::format("frame {}: {}", i, error.what()));
    }
  }
  std::stable_sort(images.begin(), images.end(), [](const PosedImage& a, const PosedImage& b) {
    const std::string &x = a.depth.native(), &y = b.depth.native();
    return std::tuple(x.size(), std::string_view(x)) < std::tuple(y.size(), std::string_view(y));
  });
  return images;
}

void read_frames(const nlohmann::json& json, const fs::path& folder, Recording& recording,
                 std::vector<Camera>& cameras) {
  const auto images = read_images(json, folder);
  const std::size_t all = json["frames"].size();
  if (images.empty())
    throw std::runtime_error(
        fmt::format("none of its {} frames has depth (depth_file_path): color images alone are not enough; export "
                    "depth too (from Polycam: the raw data, or ns-process-data polycam --use-depth)",
                    all));
  if (images.size() < all)
    recording.warnings.push_back(
        fmt::format("{} of {} frames have no depth (depth_file_path) and are skipped", all - images.size(), all));
  for (const PosedImage& image : images) {
    const double time = static_cast<double>(recording.entries.size()) / kFrameRate;
    recording.entries.push_back({time, image.depth, image.color});
    recording.truth.push_back({time, image.world_from_camera});
    cameras.push_back(image.camera);
  }
}

/// Depth units per meter, by nerfstudio's key or instant-ngp's. Without a key, OpenEXR holds meters.
double depth_scale_of(const nlohmann::json& all, const Recording& recording) {
  for (const char* key : {"depth_unit_scale_factor", "integer_depth_scale"}) {
    if (!all.contains(key)) continue;
    const double meters = number_at(all, key);
    if (!(meters > 0)) throw std::runtime_error(fmt::format("`{}` takes meters per unit, more than 0", key));
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
  set_frame_cameras(cameras, recording);
  return recording;
}

}  // namespace cairn
