// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A plain folder: intrinsics.json beside sorted images in depth/ and, perhaps, color/, colour/ or rgb/.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/camera_file.hpp"
#include "io/json_fields.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr const char* kExpected = "width, height, fx, fy, cx, cy and depth_scale (units per metre)";

void read_intrinsics(const nlohmann::json& j, Recording& recording, double& rate) {
  Camera& c = recording.rig.depth;
  c = {pixels_at(j, "width"),
       pixels_at(j, "height"),
       number_at(j, "fx"),
       number_at(j, "fy"),
       number_at(j, "cx"),
       number_at(j, "cy"),
       {}};
  if (const auto it = j.find("distortion"); it != j.end()) {
    const auto is_number = [](const auto& item) { return item.is_number(); };
    if (!it->is_array() || (it->size() != 5 && it->size() != 8) || !std::all_of(it->begin(), it->end(), is_number))
      throw std::runtime_error("`distortion` takes [k1, k2, p1, p2, k3], or these and [k4, k5, k6]");
    for (std::size_t i = 0; i < it->size(); ++i) (*it)[i].get_to(c.distortion[i]);
  }
  check(c);
  recording.depth_scale = number_at(j, "depth_scale", 1000.0);
  check_depth_scale(recording.depth_scale);
  rate = number_at(j, "frame_rate", rate);
  if (!(rate >= 0.001 && rate <= 1e5))
    throw std::runtime_error(fmt::format("`frame_rate` is {}, allowed is 0.001 to 100000", rate));
}

}  // namespace

std::vector<fs::path> images_in(const fs::path& folder) {
  std::vector<fs::path> images;
  if (!fs::is_directory(folder)) return images;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const auto extension = entry.path().extension();
    if (extension == ".png" || extension == ".jpg" || extension == ".jpeg") images.push_back(entry.path());
  }
  std::sort(images.begin(), images.end());
  return images;
}

std::optional<Recording> read_intrinsics_folder(const fs::path& folder) {
  const fs::path file = folder / "intrinsics.json";
  if (!fs::exists(file)) return std::nullopt;
  Recording recording;
  recording.layout = "folder with intrinsics.json";
  double rate = 30.0;  // Hz
  read_json(file, kExpected, [&](const nlohmann::json& j) { read_intrinsics(j, recording, rate); });
  const auto depth = images_in(folder / "depth");
  if (depth.empty()) throw std::runtime_error((folder / "depth").string() + ": holds no PNG image");
  std::vector<fs::path> colour;
  for (const char* name : {"color", "colour", "rgb"})
    if (colour.empty()) colour = images_in(folder / name);
  if (!colour.empty() && colour.size() != depth.size())
    throw std::runtime_error(folder.string() + ": " + std::to_string(depth.size()) + " depth but " +
                             std::to_string(colour.size()) + " colour images; each depth image needs its own");
  for (std::size_t i = 0; i < depth.size(); ++i)
    recording.entries.push_back({static_cast<double>(i) / rate, depth[i], colour.empty() ? fs::path() : colour[i]});
  return recording;
}

}  // namespace cairn
