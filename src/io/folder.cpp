// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A plain folder: intrinsics.json beside sorted images in depth/ and, perhaps, color/, colour/ or rgb/.
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

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

}  // namespace

std::optional<Recording> read_intrinsics_folder(const fs::path& folder) {
  const fs::path file = folder / "intrinsics.json";
  if (!fs::exists(file)) return std::nullopt;
  Recording recording;
  double rate = 30.0;  // Hz
  try {
    const auto j = nlohmann::json::parse(std::ifstream(file));
    Camera& c = recording.camera;
    c = {j.at("width"), j.at("height"), j.at("fx"), j.at("fy"), j.at("cx"), j.at("cy"), {}};
    recording.depth_scale = j.value("depth_scale", 1000.0);
    rate = j.value("frame_rate", rate);
    if (j.contains("distortion")) c.distortion = j.at("distortion").get<std::array<double, 5>>();
    if (!(c.fx > 0 && c.fy > 0 && c.width > 0 && c.height > 0 && recording.depth_scale > 0 && rate > 0))
      throw std::runtime_error("focal lengths, size, depth_scale and frame_rate must be positive");
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() + ": " + error.what() +
                             "; expected width, height, fx, fy, cx, cy and depth_scale (units per metre)");
  }
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
