// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Loops between two maps as a JSON file, see docs/session.md.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "map/atlas.hpp"

namespace cairn {

struct Matches {
  std::string first, second;  // see map_id()
  std::vector<Loop> loops;    // from a keyframe of the first map to a keyframe of the second
};

/// Identifies a map by the tracked poses of its keyframes: the same for the same input in every run.
[[nodiscard]] std::string map_id(const Atlas& atlas);

/// Writes the file atomically.
void write_matches(const std::filesystem::path& file, const Matches& matches);
/// Throws std::runtime_error with the file's name if the file has another version, is damaged, or refers to keyframes
/// beyond these numbers.
[[nodiscard]] Matches read_matches(const std::filesystem::path& file, std::size_t first_keyframes,
                                   std::size_t second_keyframes);

}  // namespace cairn
