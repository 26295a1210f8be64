// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/other_cameras.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "base/file_name.hpp"
#include "base/lines.hpp"
#include "base/read_whole.hpp"
#include "base/words.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;
constexpr std::uintmax_t kMaxFileSize = 1 << 20;  // bytes of a settings file
constexpr double kMinFactor = 1e-5;               // ORB-SLAM replaces a smaller DepthMapFactor by 1

// ORB-SLAM

double number_in(const YAML::Node& y, const std::string& key, std::optional<double> fallback = {}) {
  if (!y[key] && fallback) return *fallback;
  if (!y[key]) throw std::runtime_error(fmt::format("`{}` is missing", key));
  double value = NAN;
  try {
    value = y[key].as<double>();
  } catch (const YAML::Exception&) {
    // Not a number.
  }
  if (!std::isfinite(value)) throw std::runtime_error(fmt::format("`{}` takes a number", key));
  return value;
}

Camera camera_of_settings(const YAML::Node& y, const std::string& prefix) {
  const auto number = [&](const char* key, std::optional<double> fallback = {}) {
    return number_in(y, prefix + key, fallback);
  };
  Camera c;
  c.fx = number("fx"), c.fy = number("fy"), c.cx = number("cx"), c.cy = number("cy");
  const std::string type = y["Camera.type"] ? y["Camera.type"].as<std::string>() : "PinHole";
  if (type == "KannalaBrandt8") {
    c.lens = Lens::fisheye;
    c.distortion = {number("k1"), number("k2"), number("k3"), number("k4")};
  } else if (type == "PinHole" || type == "Pinhole") {
    c.distortion = {number("k1", 0), number("k2", 0), number("p1", 0), number("p2", 0), number("k3", 0)};
  } else if (type != "Rectified") {
    throw std::runtime_error(fmt::format(
        "`Camera.type` is '{}', expected PinHole, KannalaBrandt8 or Rectified; write camera.yaml", shown(type)));
  }
  return c;
}

// COLMAP

constexpr int kNone = -1;
/// Parameters of a camera model: their number, and the target index of each distortion parameter. A single focal length
/// is stored in fx, and `one_focal` is set.
struct ColmapModel {
  std::string_view name;
  bool one_focal;
  Lens lens;
  std::array<int, 8> distortion;  // indices in Camera::distortion, in the order of the parameters after cy
  std::size_t parameters;
};
constexpr std::array kModels{ColmapModel{"SIMPLE_PINHOLE", true, Lens::brown_conrady, {}, 3},
                             ColmapModel{"PINHOLE", false, Lens::brown_conrady, {}, 4},
                             ColmapModel{"SIMPLE_RADIAL", true, Lens::brown_conrady, {0}, 4},
                             ColmapModel{"RADIAL", true, Lens::brown_conrady, {0, 1}, 5},
                             ColmapModel{"OPENCV", false, Lens::brown_conrady, {0, 1, 2, 3}, 8},
                             ColmapModel{"FULL_OPENCV", false, Lens::brown_conrady, {0, 1, 2, 3, 4, 5, 6, 7}, 12},
                             ColmapModel{"SIMPLE_RADIAL_FISHEYE", true, Lens::fisheye, {0}, 4},
                             ColmapModel{"RADIAL_FISHEYE", true, Lens::fisheye, {0, 1}, 5},
                             ColmapModel{"OPENCV_FISHEYE", false, Lens::fisheye, {0, 1, 2, 3}, 8}};

Camera camera_of_line(const std::vector<std::string>& words) {
  if (words.size() < 5) throw std::runtime_error("expected `CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]`");
  const auto* const model =
      std::find_if(kModels.begin(), kModels.end(), [&](const ColmapModel& m) { return m.name == words[1]; });
  if (model == kModels.end())
    throw std::runtime_error(fmt::format(
        "the model '{}' is not supported; undistort the images with `colmap image_undistorter`, and give their camera",
        shown(words[1])));
  if (words.size() != 4 + model->parameters)
    throw std::runtime_error(
        fmt::format("{} takes {} parameters, found {}", model->name, model->parameters, words.size() - 4));
  std::vector<double> values;
  for (std::size_t i = 2; i < words.size(); ++i) {
    const auto value = cairn::number_in(words[i]);
    if (!value || !std::isfinite(*value))
      throw std::runtime_error(fmt::format("'{}' is not a number", shown(words[i])));
    values.push_back(*value);
  }
  const auto pixels = [](double value) { return value >= 0 && value <= 1e6 ? static_cast<int>(value) : kNone; };
  const std::size_t after = model->one_focal ? 3 : 4;  // values: width, height, focal lengths, cx, cy, lens
  // The center of COLMAP's upper left pixel is (0.5, 0.5).
  Camera c{pixels(values[0]),   pixels(values[1]),       values[2], values[after - 1],
           values[after] - 0.5, values[after + 1] - 0.5, {},        model->lens};
  for (std::size_t i = 0; i + after + 2 < values.size(); ++i)
    c.distortion[static_cast<std::size_t>(model->distortion[i])] = values[i + after + 2];
  check(c);
  return c;
}

bool has_orb_slam_key(const fs::path& file) {
  std::error_code ignored;
  if (fs::file_size(file, ignored) > kMaxFileSize || ignored) return false;
  try {
    const auto bytes = read_whole(file);
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    return text.find("Camera.fx") != text.npos || text.find("Camera1.fx") != text.npos;
  } catch (const std::runtime_error&) {
    return false;
  }
}

}  // namespace

std::optional<CameraFile> orb_slam_camera(const YAML::Node& y) {
  if (!y.IsMap()) return std::nullopt;
  const bool is_third = y["Camera1.fx"] || y["Camera1.fy"] || y["Camera1.cx"];
  if (!is_third && !y["Camera.fx"] && !y["Camera.fy"] && !y["Camera.cx"]) return std::nullopt;
  CameraFile file;
  Camera& c = file.rig.depth;
  c = camera_of_settings(y, is_third ? "Camera1." : "Camera.");
  file.has_size = y["Camera.width"] && y["Camera.height"];
  if (file.has_size) {
    const auto pixels = [&](const char* key) { return static_cast<int>(std::clamp(number_in(y, key), -1.0, 1e6)); };
    c.width = pixels("Camera.width"), c.height = pixels("Camera.height");
    check(c);
  }
  for (const char* key : {"RGBD.DepthMapFactor", "DepthMapFactor"})
    if (y[key] && !file.depth_scale) {
      const double factor = number_in(y, key);
      file.depth_scale = std::abs(factor) < kMinFactor ? 1 : factor;
      check_depth_scale(*file.depth_scale);
    }
  if (y["Camera.fps"]) {
    file.frame_rate = number_in(y, "Camera.fps");
    check_frame_rate(*file.frame_rate);
  }
  return file;
}

CameraFile colmap_camera(const fs::path& file) {
  std::optional<Camera> camera;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    try {
      const Camera found = camera_of_line(words);
      if (camera && found != *camera)
        throw std::runtime_error("differs from the first camera; a recording has one: keep only its line");
      camera = found;
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(fmt::format("line {}: {}", line, error.what()));
    }
  });
  if (!camera) throw std::runtime_error("has no camera; expected `CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]`");
  return {.rig = *camera};
}

std::vector<fs::path> other_camera_files(const fs::path& folder) {
  std::vector<fs::path> found, settings;
  std::error_code ignored;
  for (const fs::path below : {"", "sparse/0", "sparse", "colmap/sparse/0"})
    if (fs::exists(folder / below / "cameras.txt", ignored)) found.push_back(folder / below / "cameras.txt");
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string extension = extension_of(entry.path());
    if ((extension == ".yaml" || extension == ".yml") && !entry.is_directory(ignored) && has_orb_slam_key(entry.path()))
      settings.push_back(entry.path());
  }
  std::sort(settings.begin(), settings.end());
  found.insert(found.end(), settings.begin(), settings.end());
  return found;
}

}  // namespace cairn
