// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "cairn/viewer.hpp"
#include "view/finished_map.hpp"
#include "view/report_page.hpp"
#include "view/server.hpp"

namespace cairn {
namespace {

Server::Files files_of(const std::filesystem::path& map) {
  Server::Files files = std::filesystem::is_directory(map) ? FinishedMap(map).served() : served_file(map);
  std::vector<std::string> soon{"data.json"};
  if (files.count(kFirstMesh) > 0) soon.emplace_back(kFirstMesh);
  files[""] = viewer_file(soon);
  return files;
}

}  // namespace

struct MapViewer::State {
  Server server;
};

MapViewer::MapViewer(const std::filesystem::path& map, const ViewerAddress& at)
    : state_(new State{Server(at, files_of(map), nullptr)}) {}
MapViewer::~MapViewer() = default;

const ViewerSite& MapViewer::site() const { return state_->server.site(); }

}  // namespace cairn
