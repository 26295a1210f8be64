// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// nerfstudio's transforms.json (Tancik et al. 2023) with depth images. Poses are those of OpenGL, x right, y up, z
// back; the centre of the upper left pixel is (0.5, 0.5).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "base/words.hpp"
#include "io/camera_file.hpp"
#include "io/json_fields.hpp"
#include "io/pose_matrix.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kFrameRate = 30.0;  // Hz; frames have no time stamps
constexpr const char* kExpected =
    "`frames` with file_path, depth_file_path and transform_matrix, and fl_x, fl_y, cx, cy, w and h";

/// An object's own field, or the whole file's.
const nlohmann::json& holder(const nlohmann::json& frame, const nlohmann::json& all, const char* key) {
  return frame.contains(key) ? frame : all;
}

std::string text_at(const nlohmann::json& object, const char* key) {
  const auto it = object.find(key);
  if (it == object.end()) throw std::runtime_error(fmt::format("`{}` is missing", key));
  if (!it->is_string()) throw std::runtime_error(fmt::format("`{}` is not a text", key));
  return it->get<std::string>();
}

Camera camera_of(const nlohmann::json& frame, const nlohmann::json& all) {
  const auto number = [&](const char* key, std::optional<double> usual = {}) {
    return number_at(holder(frame, all, key), key, usual);
  };
  const auto pixels = [&](const char* key) { return pixels_at(holder(frame, all, key), key); };
  Camera c{pixels("w"), pixels("h"), number("fl_x"), 0, number("cx") - 0.5, number("cy") - 0.5, {}};
  c.fy = number("fl_y", c.fx);
  const nlohmann::json& says = holder(frame, all, "camera_model");
  const std::string model = says.contains("camera_model") ? text_at(says, "camera_model") : "OPENCV";
  const auto d = [&](const char* key) { return number(key, 0.0); };
  if (model == "OPENCV_FISHEYE") {
    c.lens = Lens::fisheye;
    c.distortion = {d("k1"), d("k2"), d("k3"), d("k4")};
  } else if (model == "OPENCV" || model == "PINHOLE" || model == "SIMPLE_PINHOLE") {
    // Nerfstudio's k4 is the next power of the radius, which Brown's model as used here has not.
    if (d("k4") != 0) throw std::runtime_error("`k4` is not 0, which only camera_model OPENCV_FISHEYE may have");
    c.distortion = {d("k1"), d("k2"), d("p1"), d("p2"), d("k3")};
  } else {
    throw std::runtime_error(
        fmt::format("`camera_model` is '{}', known are OPENCV, OPENCV_FISHEYE and PINHOLE", shown(model)));
  }
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
  Eigen::Isometry3d opengl_from_camera = Eigen::Isometry3d::Identity();  // half a turn about x
  opengl_from_camera.linear().diagonal() = Eigen::Vector3d(1, -1, -1);
  return *pose * opengl_from_camera;
}

struct Shot {
  std::string depth, colour;
  Eigen::Isometry3d world_from_camera;
};

void read_frames(const nlohmann::json& json, const fs::path& folder, Recording& recording, Camera& camera) {
  const auto frames = json.find("frames");
  if (frames == json.end() || !frames->is_array() || frames->empty())
    throw std::runtime_error("`frames` is missing or empty");
  std::vector<Shot> shots;
  for (std::size_t i = 0; i < frames->size(); ++i) {
    const nlohmann::json& frame = (*frames)[i];
    try {
      if (!frame.is_object()) throw std::runtime_error("is no JSON object");
      const Camera its = camera_of(frame, json);
      if (i == 0) camera = its;
      if (its != camera)
        throw std::runtime_error("its intrinsics are not those of frame 0; a recording has one camera, split it");
      shots.push_back({text_at(frame, "depth_file_path"),
                       frame.contains("file_path") ? text_at(frame, "file_path") : "", pose_in(frame)});
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(fmt::format("frame {}: {}", i, error.what()));
    }
  }
  // As they were taken: frame_2 comes before frame_10. Structure from motion leaves them in another order.
  std::stable_sort(shots.begin(), shots.end(), [](const Shot& a, const Shot& b) {
    return std::tuple(a.depth.size(), std::string_view(a.depth)) <
           std::tuple(b.depth.size(), std::string_view(b.depth));
  });
  for (const auto& [depth, colour, pose] : shots) {
    const double time = static_cast<double>(recording.entries.size()) / kFrameRate;
    recording.entries.push_back({time, folder / depth, colour.empty() ? fs::path() : folder / colour});
    recording.truth.push_back({time, pose});
  }
}

}  // namespace

std::optional<Recording> read_nerfstudio(const fs::path& folder) {
  const fs::path file = folder / "transforms.json";
  if (!fs::exists(file)) return std::nullopt;
  Recording recording;
  recording.layout = "nerfstudio folder";
  recording.has_device_poses = true;
  Camera camera;
  read_json(file, kExpected, [&](const nlohmann::json& json) {
    const double metres = number_at(json, "depth_unit_scale_factor", 1e-3);
    if (!(metres > 0)) throw std::runtime_error("`depth_unit_scale_factor` takes metres per unit, more than 0");
    recording.depth_scale = 1 / metres;
    check_depth_scale(recording.depth_scale);
    read_frames(json, folder, recording, camera);
  });
  set_rig_in_one_place(camera, recording);
  return recording;
}

}  // namespace cairn
