// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/change.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "cairn/parts.hpp"
#include "cairn/quoted.hpp"
#include "export/map_contents.hpp"
#include "map/map_state.hpp"
#include "session/open_session.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Index of the recording of a plan's map.
std::size_t recording_of(const PartsPlan& plan, const PartFiles& map) {
  // PLAN/maps/017/session/run-0001
  const std::string name = map.folder.parent_path().parent_path().filename().string();
  const auto part = std::find_if(plan.parts.begin(), plan.parts.end(), [&](const auto& p) { return p.name == name; });
  if (part == plan.parts.end())
    throw std::runtime_error(map.folder.string() + ": is no part of the plan; run cairn optimise again");
  return part->recording;
}

}  // namespace

ExportedChange export_change(const fs::path& before, const fs::path& after, const fs::path& file,
                             const ChangeOptions& options, const ExportProgress& progress, int device) {
  check(options, file);
  const Map then = Map::open(before, device), now = Map::open(after, device);
  ExportedChange exported;
  then.contents().look([&](const MapParts& earlier) {
    now.contents().look([&](const MapParts& later) {
      exported = write_change({before.string(), earlier}, {after.string(), later}, file, options, progress);
    });
  });
  return exported;
}

ExportedChange export_change_since(const fs::path& folder, std::size_t recording, const fs::path& file,
                                   const ChangeOptions& options, const ExportProgress& progress, int device) {
  check(options, file);
  const PartsPlan plan = read_plan(folder);
  if (recording == 0 || recording >= plan.recordings.size())
    throw std::runtime_error(fmt::format("{}: has recordings 0 to {}: none is before recording {}, or it is not there",
                                         folder.string(), plan.recordings.size() - 1, recording));
  if (!fs::exists(folder / "session" / "state.cbor"))
    throw std::runtime_error(
        fmt::format("{}: has no map yet; make it with cairn optimise {}", folder.string(), quoted(folder)));
  const auto state = open_session(folder / "session", device);
  const std::vector<PartFiles>& parts = state->files.parts;
  std::vector<std::size_t> earlier, later;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const std::size_t end = p + 1 < parts.size() ? parts[p + 1].first_submap : state->back_end.submaps().size();
    auto& side = recording_of(plan, parts[p]) < recording ? earlier : later;
    for (std::size_t s = parts[p].first_submap; s < end; ++s) side.push_back(s);
  }
  for (const auto* side : {&earlier, &later})
    if (state->back_end.placed_submaps(side).empty())
      throw std::runtime_error(fmt::format(
          "{}: nothing that was recorded {} recording {} is in its map; cairn optimise {} tells why it is left out",
          folder.string(), side == &later ? "from" : "before", recording, quoted(folder)));
  ExportedChange exported;
  look_at(*state, &earlier, [&](const MapParts& then) {
    look_at(*state, &later, [&](const MapParts& now) {
      exported = write_change({fmt::format("what was recorded before recording {}", recording), then},
                              {fmt::format("what was recorded from recording {} on", recording), now}, file, options,
                              progress);
    });
  });
  return exported;
}

}  // namespace cairn
