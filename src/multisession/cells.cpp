// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "multisession/cells.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>

#include "base/changed_file.hpp"
#include "base/json_text.hpp"
#include "base/quoted.hpp"
#include "cairn/building/project.hpp"
#include "export/cells.hpp"
#include "geometry/pose_checksum.hpp"
#include "map/deform.hpp"
#include "mapper/map_state.hpp"
#include "session/json_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr JsonKind kCell{"cairn cell", "is not a map cell", "make it again with cairn optimize"};

std::string name_of(const CellName& cell) { return fmt::format("{},{},{}", cell[0], cell[1], cell[2]); }

std::optional<CellName> cell_named(const std::string& name) {
  CellName cell{};
  const char *at = name.data(), *const end = at + name.size();
  for (std::size_t i = 0; i < cell.size(); ++i) {
    if (i > 0 && (at == end || *at++ != ',')) return std::nullopt;
    const auto [end_of_number, error] = std::from_chars(at, end, cell[i]);
    if (error != std::errc()) return std::nullopt;
    at = end_of_number;
  }
  if (at != end) return std::nullopt;
  return cell;
}

/// Conservative test if a camera can see a ball.
class ViewCone {
 public:
  ViewCone(const Camera& camera, double max_depth) : max_depth_(max_depth) {
    for (const double u : {0.0, camera.width - 1.0})
      for (const double v : {0.0, camera.height - 1.0})
        half_angle_ = std::max(half_angle_, std::atan(camera.ray(u, v).head<2>().norm()));
  }
  [[nodiscard]] bool sees(const Eigen::Vector3d& center, double radius) const {  // in the camera's frame
    const double distance = center.norm();
    if (distance <= radius) return true;
    return distance - radius <= max_depth_ &&
           std::acos(std::clamp(center.z() / distance, -1.0, 1.0)) <= half_angle_ + std::asin(radius / distance);
  }

 private:
  double max_depth_, half_angle_ = 0;
};

/// Submaps and keyframes of a map, in the map's own numbering.
struct CellSources {
  std::vector<std::size_t> submaps, keyframes;
};

template <class Numbers>
std::size_t map_with(const std::vector<SessionMerger::Map>& maps, std::size_t number, const Numbers& numbers) {
  std::size_t m = 0;
  while (number - numbers(maps[m]).first >= numbers(maps[m]).second)
    ++m;  // unsigned: also false for numbers below the
          // first
  return m;
}

/// Checksum of the poses of keyframes with a view of a cell and of keyframes used to deform submaps in the cell.
std::string poses_of(const Atlas& atlas, const SessionMerger::Map& map, const CellSources& sources) {
  std::set<std::size_t> keyframes;
  for (const std::size_t k : sources.keyframes) keyframes.insert(map.files.first_keyframe + k);
  for (const std::size_t s : sources.submaps)
    for (const std::size_t k : Deformation::keyframes_of(atlas, map.files.first_submap + s)) keyframes.insert(k);
  PoseChecksum sum;
  for (const std::size_t k : keyframes) sum.add(atlas.world_from_camera[k]);
  return sum.text();
}

}  // namespace

fs::path cell_file(const fs::path& plan, const CellName& cell) { return plan / "cells" / (name_of(cell) + ".json"); }

fs::path cell_folder(const fs::path& plan, const CellName& cell) { return plan / "tiles" / name_of(cell); }

fs::path file_of_cell(const fs::path& plan, const CellName& cell, const char* name) {
  const fs::path folder = cell_folder(plan, cell);
  if (fs::path file = folder / name; fs::exists(file)) return file;
  throw std::runtime_error(fmt::format("{}: is missing; make it with cairn tile {} --cell={} -o {}",
                                       (folder / name).string(), quoted(plan), name_of(cell), quoted(folder)));
}

WrittenCells write_cells(const fs::path& plan, MapState& state, const std::vector<SessionMerger::Map>& maps) {
  const Atlas& atlas = state.back_end.atlas();
  const float brick = 8 * state.options.fuse.voxel_size;
  const auto component = atlas.components();
  const std::size_t main = atlas.main_component();
  const ViewCone view_cone(state.rig.depth.rectified(), static_cast<double>(state.options.surface.max_depth));
  const double side = static_cast<double>(brick) * Cells::kBlockSide, radius = side * std::sqrt(3.0) / 2;
  const Eigen::Quaterniond& rotation = state.upright().world_from_tracked;
  fs::create_directories(plan / "cells");
  WrittenCells written;
  std::set<std::string> names;
  for (const ReachedCell& reached : reached_cells(state.options.fuse, state.back_end.placed_submaps(),
                                                  Cells::kBlockSide, Cells::margin(ExportOptions{}.clean, brick))) {
    std::map<std::size_t, CellSources> sources;
    for (const std::size_t s : reached.submaps) {
      const std::size_t m =
          map_with(maps, s, [](const auto& map) { return std::pair(map.files.first_submap, map.submaps); });
      sources[m].submaps.push_back(s - maps[m].files.first_submap);
    }
    const Eigen::Vector3d center = (reached.cell.cast<double>().array() + 0.5) * side;
    for (std::size_t m = 0; m < maps.size(); ++m)
      for (std::size_t k = 0; k < maps[m].files.keyframes; ++k) {
        const std::size_t keyframe = maps[m].files.first_keyframe + k;
        if (component[keyframe] == main && view_cone.sees(atlas.world_from_camera[keyframe].inverse() * center, radius))
          sources[m].keyframes.push_back(k);
      }
    Json json{{"kind", kCell.kind},
              {"format", kCell.format},
              {"cell", {reached.cell.x(), reached.cell.y(), reached.cell.z()}},
              {"upright", {rotation.x(), rotation.y(), rotation.z(), rotation.w()}},
              {"made_of", Json::array()}};
    for (const auto& [m, of_map] : sources)
      json["made_of"].push_back({{"map", maps[m].files.folder.lexically_proximate(fs::absolute(plan)).string()},
                                 {"keyframes_of_map", maps[m].id},
                                 {"poses", poses_of(atlas, maps[m], of_map)},
                                 {"submaps", of_map.submaps},
                                 {"keyframes", of_map.keyframes}});
    const CellName cell{reached.cell.x(), reached.cell.y(), reached.cell.z()};
    ++written.cells;
    names.insert(cell_file(plan, cell).filename());
    written.changed += write_changed(cell_file(plan, cell), text_of(json) + '\n');
  }
  for (const CellName& cell : cells_of(plan))
    if (!names.contains(cell_file(plan, cell).filename())) fs::remove(cell_file(plan, cell));
  return written;
}

MapBlock read_cell(const fs::path& plan, const CellName& cell, const std::vector<SourceMapFiles>& source_maps) {
  const fs::path file = cell_file(plan, cell);
  if (!fs::exists(file))
    throw std::runtime_error(
        fmt::format("{}: is missing: the map does not reach cell {}, or does not exist yet (cairn "
                    "optimize {})",
                    file.string(), name_of(cell), plan.string()));
  return read_json_file(file, kCell, [&](const Json& json) {
    MapBlock block{.block = {cell[0], cell[1], cell[2]}, .submaps = {}, .keyframes = {}};
    for (const Json& of_map : json.at("made_of")) {
      const fs::path folder = (fs::absolute(plan) / of_map.at("map").get<std::string>()).lexically_normal();
      const auto source = std::find_if(source_maps.begin(), source_maps.end(), [&](const SourceMapFiles& p) {
        return fs::absolute(p.folder).lexically_normal() == folder;
      });
      if (source == source_maps.end()) throw std::runtime_error("refers to a map that is not part of this one");
      for (const std::size_t s : of_map.at("submaps")) {
        if (s > source->submaps) throw std::runtime_error("refers to a missing submap");
        block.submaps.push_back(source->first_submap + s);
      }
      for (const std::size_t k : of_map.at("keyframes")) {
        if (k >= source->keyframes) throw std::runtime_error("refers to a missing keyframe");
        block.keyframes.push_back(source->first_keyframe + k);
      }
    }
    std::sort(block.submaps.begin(), block.submaps.end());
    std::sort(block.keyframes.begin(), block.keyframes.end());
    return block;
  });
}

std::vector<CellName> cells_of(const fs::path& plan) {
  std::vector<CellName> cells;
  std::error_code missing;
  for (const auto& entry : fs::directory_iterator(plan / "cells", missing))
    if (entry.path().extension() == ".json")
      if (const auto cell = cell_named(entry.path().stem().string())) cells.push_back(*cell);
  std::sort(cells.begin(), cells.end());
  return cells;
}

}  // namespace cairn
