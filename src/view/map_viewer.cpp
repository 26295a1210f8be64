// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "cairn/mapping/viewer.hpp"
#include "net/server.hpp"
#include "view/finished_map.hpp"
#include "view/report_page.hpp"
#include "view/served_tileset.hpp"

namespace cairn {
namespace {

Server::Files shown(const std::filesystem::path& map, AddFiles add) {
  if (const auto tileset = tileset_of(map)) return served_tileset(*tileset, std::move(add));
  return std::filesystem::is_directory(map) ? FinishedMap(map).served() : served_file(map);
}

Server::Files files_of(const std::filesystem::path& map, AddFiles add) {
  Server::Files files = shown(map, std::move(add));
  std::vector<std::string> preloaded{"data.json"};
  if (files.count(kFirstMesh) > 0) preloaded.emplace_back(kFirstMesh);
  files[""] = viewer_file(preloaded);
  return files;
}

}  // namespace

struct MapViewer::State {
  State(const std::filesystem::path& map, const ViewerAddress& at)
      : server(at, files_of(map, [this](Server::Files&& more) { server.add(std::move(more)); }), nullptr) {}
  Server server;
};

MapViewer::MapViewer(const std::filesystem::path& map, const ViewerAddress& at)
    : state_(std::make_unique<State>(map, at)) {}
MapViewer::~MapViewer() = default;

const ViewerSite& MapViewer::site() const { return state_->server.site(); }
bool MapViewer::is_opened() const { return state_->server.is_opened(); }

}  // namespace cairn
