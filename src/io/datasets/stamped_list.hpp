// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Image lists with times, in the format of TUM's tools and compatible programs.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

struct Stamped {
  double timestamp;  // seconds
  std::filesystem::path image;
};

/// Reads lines of `groups` pairs of a time and a path, separated by spaces, tabs or commas. Paths may contain spaces
/// and Windows backslashes; they are relative to the file's folder. Throws std::runtime_error with file and line, and
/// for a file without images. Result by group, then by line; times are in the file's unit.
[[nodiscard]] std::vector<std::vector<Stamped>> read_stamped_lists(const std::filesystem::path& file,
                                                                   std::size_t groups);

/// Estimates the units per second of integer times: 1, 1e3, 1e6 or 1e9, from their median step as in numbering_of(); 1
/// if some times are not integers.
[[nodiscard]] double units_per_second(const std::vector<Stamped>& list);
void divide_times(std::vector<Stamped>& list, double units_per_second);

}  // namespace cairn
