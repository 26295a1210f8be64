// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/json_text.hpp"
#include "base/quoted.hpp"
#include "cairn/building/project.hpp"
#include "export/cells.hpp"
#include "export/map_contents.hpp"
#include "export/tiles_above.hpp"
#include "export/tiles_folder.hpp"
#include "mapper/map_state.hpp"
#include "mesh/tiles.hpp"
#include "multisession/cells.hpp"
#include "multisession/segment_loops.hpp"
#include "multisession/session_merger.hpp"
#include "session/open_session.hpp"
#include "session/session_files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kState = "state.cbor";

fs::path session_of(const fs::path& map) { return map / "session"; }

/// Adds the loops of a file between two maps, if the file exists.
void add_matches(SessionMerger& merger, const fs::path& file, std::size_t first, std::size_t second) {
  if (!fs::exists(file)) return;
  const auto& maps = merger.maps();
  Matches matches = read_matches(file, maps[first].files.keyframes, maps[second].files.keyframes);
  if (matches.first != maps[first].id || matches.second != maps[second].id)
    throw std::runtime_error(file.string() + ": refers to maps that were rebuilt; make it again with cairn match");
  merger.add_loops(first, second, std::move(matches.loops));
}

/// Previous merged map, if still readable.
std::optional<ReadSession> earlier_session(const fs::path& plan) {
  if (!fs::exists(session_of(plan) / kState)) return std::nullopt;
  try {
    return read_session(session_of(plan));
  } catch (const std::exception&) {
    return std::nullopt;  // a segment's map was replaced
  }
}

}  // namespace

MatchedMaps match_maps(const fs::path& first, const fs::path& second, const fs::path& file, int device) {
  const auto a = open_session(session_of(first), device), b = open_session(session_of(second), device);
  check_alike({first, a->rig, a->options.fuse}, {second, b->rig, b->options.fuse}, "matched");
  const Matches matches{.first = map_id(a->back_end.atlas()),
                        .second = map_id(b->back_end.atlas()),
                        .loops = a->back_end.match(b->back_end)};
  write_matches(file, matches);
  return {.compared = static_cast<int>(b->back_end.atlas().keyframes.size()),
          .loops = static_cast<int>(matches.loops.size())};
}

OptimizedProject optimize_project(const fs::path& folder, int device) {
  const Project plan = read_plan(folder);
  OptimizedProject optimized;
  std::optional<ReadSession> earlier = earlier_session(folder);
  SessionWriter writer(session_of(folder));
  SessionMerger merger(writer);
  std::vector<std::size_t> map_segments;  // segment of the plan, by map
  for (std::size_t p = 0; p < plan.segments.size(); ++p) {
    const Project::Segment& segment = plan.segments[p];
    MergedSegment& result = optimized.segments.emplace_back();
    result.name = segment.name;
    result.recording = static_cast<int>(segment.recording);
    const fs::path map = folder / "maps" / segment.name, session = session_of(map);
    if (fs::exists(map / "failed.txt") || !fs::exists(session / kState)) {
      result.left_out =
          fs::exists(session / kState) ? "its run failed, see " + (map / "failed.txt").string() : "it has no map";
      continue;
    }
    merger.add(session, segment.recording);
    map_segments.push_back(p);
    result.keyframes = static_cast<int>(merger.maps().back().files.keyframes);
    result.frames = static_cast<int>(merger.maps().back().frames);
  }
  if (map_segments.empty())
    throw std::runtime_error(folder.string() + ": no part has a map yet; create them with cairn reconstruct");
  for (std::size_t b = 0; b < map_segments.size(); ++b)
    for (std::size_t a = 0; a < b; ++a)
      add_matches(merger,
                  folder / "loops" /
                      (plan.segments[map_segments[a]].name + "-" + plan.segments[map_segments[b]].name + ".json"),
                  a, b);

  const SessionMerger::Report report = merger.merge(plan.recordings.size(), device);
  optimized.loops = report.loops, optimized.inliers = report.inliers, optimized.overlaps = report.overlaps;
  optimized.pairs = report.pairs, optimized.aligned = report.aligned;
  optimized.cost_before = report.graph.cost_before, optimized.cost = report.graph.cost;
  optimized.seconds = report.graph.seconds;
  if (earlier) {
    const auto moved = merger.restore_poses(*earlier);
    for (std::size_t m = 0; m < moved.size(); ++m) optimized.segments[map_segments[m]].moved = moved[m].value_or(0);
  }
  earlier.reset();  // its files are removed when the new ones are written
  merger.write();

  for (std::size_t m = 0; m < map_segments.size(); ++m) {
    if (!merger.is_merged(m)) {
      optimized.segments[map_segments[m]].left_out = kUnjoined;
      continue;
    }
    optimized.keyframes += static_cast<int>(merger.maps()[m].files.keyframes);
    optimized.submaps += static_cast<int>(merger.maps()[m].submaps);
  }
  const auto state = open_session(session_of(folder), device);
  const WrittenCells cells = write_cells(folder, *state, merger.maps());
  optimized.cells = cells.cells, optimized.changed_cells = cells.changed;
  return optimized;
}

ExportReport export_cell(const fs::path& plan, const std::array<int, 3>& cell, const fs::path& folder,
                         const ExportOptions& options, const ExportProgress& progress, int device) {
  check(options, folder / "tileset.json");
  const auto state = open_session(session_of(plan), device);
  const float brick = 8 * state->options.fuse.voxel_size;
  if (Cells::margin(options.clean, brick) > Cells::margin(ExportOptions{}.clean, brick))
    throw std::runtime_error(
        fmt::format("{}: is not written: components and holes larger than {} m reach beyond the "
                    "margin of a cell; use a smaller size",
                    folder.string(), ExportOptions{}.clean.min_component));
  const MapBlock block = read_cell(plan, cell, state->files.source_maps);
  fs::create_directories(folder);
  return export_block(*state, block, folder, options, progress);
}

std::vector<SegmentSurface> segment_surfaces(const fs::path& plan, const std::array<int, 3>& cell, int device) {
  const auto state = open_session(session_of(plan), device);
  const std::vector<SourceMapFiles>& source_maps = state->files.source_maps;
  const MapBlock block = read_cell(plan, cell, source_maps);
  std::vector<SegmentSurface> surfaces;
  for (std::size_t p = 0; p < source_maps.size(); ++p) {
    const std::size_t end =
        p + 1 < source_maps.size() ? source_maps[p + 1].first_submap : state->back_end.submaps().size();
    std::vector<std::size_t> own;
    std::copy_if(block.submaps.begin(), block.submaps.end(), std::back_inserter(own),
                 [&](std::size_t s) { return source_maps[p].first_submap <= s && s < end; });
    if (own.empty()) continue;
    // PLAN/maps/017/session/run-0001
    const std::string name = source_maps[p].folder.parent_path().parent_path().filename().string();
    surfaces.push_back({name, surface_of_block(*state, block.block, own)});
  }
  return surfaces;
}

int write_cells_tileset(const fs::path& plan, const fs::path& file) {
  std::vector<CellTile> cells;
  const fs::path home = fs::absolute(file).parent_path();
  for (const CellName& cell : cells_of(plan)) {
    const fs::path tileset = file_of_cell(plan, cell, "tileset.json");
    TilesetFile made = read_tileset_file(tileset);
    if (made.content.empty()) continue;
    made.root.content = as_uri(fs::absolute(tileset).lexically_proximate(home).generic_string());
    cells.push_back({Brick(cell[0], cell[1], cell[2]), std::move(made.root), made.content});
  }
  if (cells.empty())
    throw std::runtime_error(plan.string() + ": has no cell with a surface; run cairn optimize " + quoted(plan));
  const int count = static_cast<int>(cells.size());
  if (count == 1) {
    write_tileset(file, cells[0].tile);
    return count;
  }
  TilesFolder tiles(file);
  Tile root = tiles_above(std::move(cells), tiles.part());
  put_into(root, tiles.finish());
  write_tileset(file, root);
  tiles.keep();
  return count;
}

}  // namespace cairn
