// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/tiles.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "cairn/atomic_file.hpp"

namespace cairn {
namespace {

nlohmann::json to_json(const Tile& tile) {
  // The world is y down and z forward, so up is -y and forward, which comes from glTF's -z, is y.
  const Eigen::Vector3f c = tile.box.center(), h = (tile.box.sizes() / 2).cwiseMax(1e-3f);
  nlohmann::json j{{"boundingVolume", {{"box", {c.x(), c.z(), -c.y(), h.x(), 0, 0, 0, h.z(), 0, 0, 0, h.y()}}}},
                   {"geometricError", tile.children.empty() ? 0.0 : tile.error}};
  if (!tile.content.empty()) j["content"] = {{"uri", tile.content}};
  for (const Tile& child : tile.children) j["children"].push_back(to_json(child));
  return j;
}

}  // namespace

void write_tileset(const std::filesystem::path& file, const Tile& root) {
  nlohmann::json j{{"asset", {{"version", "1.1"}, {"tilesetVersion", "1"}}},
                   {"geometricError", std::max<double>(root.error, root.box.diagonal().norm() / 8)},
                   {"root", to_json(root)}};
  j["root"]["refine"] = "REPLACE";
  write_whole(file, j.dump(1) + '\n');
}

}  // namespace cairn
