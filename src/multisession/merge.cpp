// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/building/merge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "mapper/map_state.hpp"
#include "multisession/session_merger.hpp"
#include "session/open_session.hpp"

namespace cairn {

namespace fs = std::filesystem;

std::vector<MergedSession> merge_sessions(const std::vector<fs::path>& maps, const fs::path& to, bool allow_unmerged,
                                          int device) {
  SessionWriter writer(to);
  SessionMerger merger(writer);
  for (std::size_t i = 0; i < maps.size(); ++i) merger.add(maps[i], i);
  std::vector<MergedSession> merged(maps.size());
  for (std::size_t a = 0; a < maps.size(); ++a) {
    const auto first = open_session(maps[a], device);  // place index is built once
    for (std::size_t b = a + 1; b < maps.size(); ++b) {
      const auto second = open_session(maps[b], device);
      merged[b].compared = static_cast<int>(second->back_end.atlas().keyframes.size());
      auto loops = first->back_end.match(second->back_end);
      merged[b].loops += static_cast<int>(loops.size());
      merger.add_loops(a, b, std::move(loops));
    }
  }
  (void)merger.merge(0, device);
  for (std::size_t i = 0; i < maps.size(); ++i) {
    merged[i].merged = merger.is_merged(i);
    if (merged[i].merged || allow_unmerged) continue;
    const std::size_t named = std::max<std::size_t>(i, 1);  // the first map is compared with none
    throw std::runtime_error(
        fmt::format("{}: {} of {} keyframes have a loop closure to the others, too few consistent ones to merge it; "
                    "record a path from "
                    "one to the other, or allow it to stay separate",
                    maps[named].string(), merged[named].loops, merged[named].compared));
  }
  merger.write(true);
  return merged;
}

}  // namespace cairn
