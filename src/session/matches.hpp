// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Loops between two maps as a file: JSON, see docs/formats.md.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "map/atlas.hpp"

namespace cairn {

struct Matches {
  std::string first, second;  // see map_id()
  std::vector<Loop> loops;    // from a keyframe of the first to one of the second
};

/// Tells maps from each other by where their keyframes were tracked: the same for the same input, whatever the run.
[[nodiscard]] std::string map_id(const Atlas& atlas);

/// Whole or not at all.
void write_matches(const std::filesystem::path& file, const Matches& matches);
/// Throws std::runtime_error naming the file: of another version, damaged, or loops of keyframes beyond these numbers.
[[nodiscard]] Matches read_matches(const std::filesystem::path& file, std::size_t first_keyframes,
                                   std::size_t second_keyframes);

}  // namespace cairn
