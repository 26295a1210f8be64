// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/tiles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "base/atomic_file.hpp"
#include "base/json_text.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"

namespace cairn {
namespace {

nlohmann::json to_json(const Tile& tile) {
  // The world is y down and z forward, so up is -y; forward, glTF's -z, is y of the tileset.
  const Eigen::AlignedBox3f box = tile.box.isEmpty() ? Eigen::AlignedBox3f(Eigen::Vector3f::Zero()) : tile.box;
  const Eigen::Vector3f c = box.center(), h = (box.sizes() / 2).cwiseMax(1e-3f);
  nlohmann::json j{{"boundingVolume", {{"box", {c.x(), c.z(), -c.y(), h.x(), 0, 0, 0, h.z(), 0, 0, 0, h.y()}}}},
                   {"geometricError", tile.children.empty() && !tile.is_tileset ? 0.0 : tile.error}};
  if (!tile.content.empty()) j["content"] = {{"uri", tile.content}};
  // An empty parent needs no replacement: with ADD, viewers show each child once loaded, and load only visible
  // children.
  j["refine"] = tile.content.empty() ? "ADD" : "REPLACE";
  for (const Tile& child : tile.children) j["children"].push_back(to_json(child));
  return j;
}

}  // namespace

Eigen::Isometry3d earth_from_tileset(const GeoPlace& place) {
  constexpr double kRadius = 6378137, kFlattening = 1 / 298.257223563;  // WGS 84
  constexpr double kEccentricity = kFlattening * (2 - kFlattening);     // squared
  const auto radians = [](double degrees) { return degrees * std::numbers::pi / 180; };
  const double lat = radians(place.latitude), lon = radians(place.longitude), turn = radians(place.heading);
  const Eigen::Vector3d east(-std::sin(lon), std::cos(lon), 0),
      north(-std::sin(lat) * std::cos(lon), -std::sin(lat) * std::sin(lon), std::cos(lat)),
      up(std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat));
  const double normal = kRadius / std::sqrt(1 - kEccentricity * std::sin(lat) * std::sin(lat));
  Eigen::Isometry3d earth = Eigen::Isometry3d::Identity();
  earth.linear() << std::cos(turn) * east - std::sin(turn) * north, std::sin(turn) * east + std::cos(turn) * north, up;
  earth.translation() =
      (normal + place.height) * up - Eigen::Vector3d::UnitZ() * kEccentricity * normal * std::sin(lat);
  return earth;
}

void put_into(Tile& tile, const std::string& folder) {
  if (tile.is_tileset) return;
  if (!tile.content.empty()) tile.content = folder + "/" + tile.content;
  for (Tile& child : tile.children) put_into(child, folder);
}

TilesetFile read_tileset_file(const std::filesystem::path& file) {
  try {
    const auto bytes = read_whole(file);
    const auto root = parsed_json(bytes).at("root");
    const auto b = root.at("boundingVolume").at("box").get<std::array<float, 12>>();
    const Eigen::Vector3f center(b[0], -b[2], b[1]), half(b[3], b[11], b[7]);
    TilesetFile read{.root = {.content = {},
                              .box = Eigen::AlignedBox3f(center - half, center + half),
                              .error = root.at("geometricError"),
                              .children = {},
                              .is_tileset = true},
                     .content = {}};
    if (root.contains("content"))
      read.content = file.parent_path() / root["content"].at("uri").get_ref<const std::string&>();
    return read;
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(file.string() + ": is not a tileset: " + plain(error.what()));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

void write_tileset(const std::filesystem::path& file, const Tile& root, const std::optional<GeoPlace>& place) {
  nlohmann::json j{{"asset", {{"version", "1.1"}, {"tilesetVersion", "1"}}},
                   {"geometricError", std::max<double>(root.error, root.box.diagonal().norm() / 8)},
                   {"root", to_json(root)}};
  if (place) {
    const Eigen::Matrix4d earth = earth_from_tileset(*place).matrix();
    j["root"]["transform"] = std::vector<double>(earth.data(), earth.data() + earth.size());  // column by column
  }
  write_whole(file, j.dump(1) + '\n');
}

}  // namespace cairn
