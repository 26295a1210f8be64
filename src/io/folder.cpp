// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A plain folder: intrinsics.json beside sorted images in depth/ and, perhaps, color/, colour/ or rgb/.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/read_whole.hpp"
#include "io/camera_file.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr const char* kExpected = "; expected width, height, fx, fy, cx, cy and depth_scale (units per metre)";

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

void read_intrinsics(const nlohmann::json& j, Recording& recording, double& rate) {
  const auto number = [&](const char* key, std::optional<double> usual = {}) {
    const auto it = j.find(key);
    if (it == j.end() && usual) return *usual;
    if (it == j.end()) throw std::runtime_error(std::string("`") + key + "` is missing");
    if (!it->is_number()) throw std::runtime_error(std::string("`") + key + "` is not a number");
    return it->get<double>();
  };
  const auto pixels = [&](const char* key) {
    const double value = number(key);
    if (!(value >= 0 && value <= 1e6 && value == std::floor(value)))
      throw std::runtime_error(std::string("`") + key + "` is no number of pixels");
    return static_cast<int>(value);
  };
  if (!j.is_object()) throw std::runtime_error("is no JSON object");
  Camera& c = recording.rig.depth;
  c = {pixels("width"), pixels("height"), number("fx"), number("fy"), number("cx"), number("cy"), {}};
  if (const auto it = j.find("distortion"); it != j.end()) {
    const auto is_number = [](const auto& item) { return item.is_number(); };
    if (!it->is_array() || (it->size() != 5 && it->size() != 8) || !std::all_of(it->begin(), it->end(), is_number))
      throw std::runtime_error("`distortion` takes [k1, k2, p1, p2, k3], or these and [k4, k5, k6]");
    for (std::size_t i = 0; i < it->size(); ++i) (*it)[i].get_to(c.distortion[i]);
  }
  check(c);
  recording.depth_scale = number("depth_scale", 1000.0);
  check_depth_scale(recording.depth_scale);
  rate = number("frame_rate", rate);
  if (!(rate >= 0.001 && rate <= 1e5))
    throw std::runtime_error(fmt::format("`frame_rate` is {}, allowed is 0.001 to 100000", rate));
}

}  // namespace

std::optional<Recording> read_intrinsics_folder(const fs::path& folder) {
  const fs::path file = folder / "intrinsics.json";
  if (!fs::exists(file)) return std::nullopt;
  Recording recording;
  double rate = 30.0;  // Hz
  try {
    const auto bytes = read_whole(file);
    read_intrinsics(nlohmann::json::parse(bytes.begin(), bytes.end()), recording, rate);
  } catch (const nlohmann::json::exception&) {
    throw std::runtime_error(file.string() + ": is no JSON" + kExpected);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what() + kExpected);
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
