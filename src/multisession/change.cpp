// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/change.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "base/quoted.hpp"
#include "cairn/building/project.hpp"
#include "export/map_contents.hpp"
#include "mapper/map_state.hpp"
#include "session/open_session.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Index of the recording of a plan's map.
std::size_t recording_of(const Project& plan, const SourceMapFiles& map) {
  // PLAN/maps/017/session/run-0001
  const std::string name = map.folder.parent_path().parent_path().filename().string();
  const auto segment =
      std::find_if(plan.segments.begin(), plan.segments.end(), [&](const auto& p) { return p.name == name; });
  if (segment == plan.segments.end())
    throw std::runtime_error(map.folder.string() + ": is not a part of the plan; run cairn optimize again");
  return segment->recording;
}

}  // namespace

ExportedChange export_change(const fs::path& before, const fs::path& after, const fs::path& file,
                             const ChangeOptions& options, const ExportProgress& progress, int device) {
  check(options, file);
  const Map earlier_map = Map::open(before, device), later_map = Map::open(after, device);
  ExportedChange exported;
  MapAccess::contents(earlier_map).look([&](const MapChunks& earlier) {
    MapAccess::contents(later_map).look([&](const MapChunks& later) {
      exported = write_change({before.string(), earlier}, {after.string(), later}, file, options, progress);
    });
  });
  return exported;
}

ExportedChange export_change_since(const fs::path& folder, std::size_t recording, const fs::path& file,
                                   const ChangeOptions& options, const ExportProgress& progress, int device) {
  check(options, file);
  const Project plan = read_plan(folder);
  if (recording == 0 || recording >= plan.recordings.size())
    throw std::runtime_error(
        fmt::format("{}: has recordings 0 to {}: recording {} is missing or has no earlier recording", folder.string(),
                    plan.recordings.size() - 1, recording));
  if (!fs::exists(folder / "session" / "state.cbor"))
    throw std::runtime_error(
        fmt::format("{}: has no map yet; make it with cairn optimize {}", folder.string(), quoted(folder)));
  const auto state = open_session(folder / "session", device);
  const std::vector<SourceMapFiles>& source_maps = state->files.source_maps;
  std::vector<std::size_t> earlier, later;
  for (std::size_t p = 0; p < source_maps.size(); ++p) {
    const std::size_t end =
        p + 1 < source_maps.size() ? source_maps[p + 1].first_submap : state->back_end.submaps().size();
    auto& submaps = recording_of(plan, source_maps[p]) < recording ? earlier : later;
    for (std::size_t s = source_maps[p].first_submap; s < end; ++s) submaps.push_back(s);
  }
  for (const auto* submaps : {&earlier, &later})
    if (state->back_end.placed_submaps(submaps).empty())
      throw std::runtime_error(
          fmt::format("{}: its map has no data recorded {} recording {}; cairn optimize {} reports the reason",
                      folder.string(), submaps == &later ? "from" : "before", recording, quoted(folder)));
  ExportedChange exported;
  look_at(*state, &earlier, [&](const MapChunks& earlier_map) {
    look_at(*state, &later, [&](const MapChunks& later_map) {
      exported = write_change({fmt::format("recordings before {}", recording), earlier_map},
                              {fmt::format("recordings from {} on", recording), later_map}, file, options, progress);
    });
  });
  return exported;
}

}  // namespace cairn
