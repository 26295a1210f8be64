// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What Open3D's recorders leave (Zhou et al. 2018): color/, depth/ and intrinsic.json or camera_intrinsic.json.
#include <algorithm>
#include <array>
#include <map>
#include <stdexcept>

#include "io/camera_file.hpp"
#include "io/json_fields.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kFrameRate = 30.0;  // Hz; the recorders keep no time stamps
constexpr const char* kExpected = "width, height and intrinsic_matrix, 9 numbers column by column";

void read_camera(const nlohmann::json& json, Recording& recording) {
  const auto it = json.find("intrinsic_matrix");
  const auto is_number = [](const auto& item) { return item.is_number(); };
  if (it == json.end()) throw std::runtime_error("`intrinsic_matrix` is missing");
  if (!it->is_array() || it->size() != 9 || !std::all_of(it->begin(), it->end(), is_number))
    throw std::runtime_error("`intrinsic_matrix` takes 9 numbers");
  const auto m = it->get<std::array<double, 9>>();
  recording.rig = Camera{pixels_at(json, "width"), pixels_at(json, "height"), m[0], m[4], m[6], m[7], {}};
  check(recording.rig.depth);
  recording.depth_scale = number_at(json, "depth_scale", 1000.0);
  check_depth_scale(recording.depth_scale);
}

}  // namespace

std::optional<Recording> read_open3d(const fs::path& folder) {
  fs::path file = folder / "intrinsic.json";
  if (!fs::exists(file)) file = folder / "camera_intrinsic.json";
  if (!fs::exists(file)) return std::nullopt;
  Recording recording;
  recording.layout = "Open3D folder";
  read_json(file, kExpected, [&](const nlohmann::json& json) { read_camera(json, recording); });
  const auto depth = images_in(folder / "depth");
  if (depth.empty()) throw std::runtime_error((folder / "depth").string() + ": holds no PNG image");
  std::map<std::string, fs::path> colour;
  for (const auto& image : images_in(folder / "color")) colour.emplace(image.stem().string(), image);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const auto seen = colour.find(depth[i].stem().string());
    recording.entries.push_back(
        {static_cast<double>(i) / kFrameRate, depth[i], seen == colour.end() ? fs::path() : seen->second});
  }
  return recording;
}

}  // namespace cairn
