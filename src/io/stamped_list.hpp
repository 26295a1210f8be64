// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Lists of images with their times, as TUM's tools and those after them write them.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

struct Stamped {
  double timestamp;  // seconds
  std::filesystem::path image;
};

/// Lines of `groups` times a time and a path, between spaces, tabs or commas. Paths may have spaces in them, and
/// Windows' backslashes; they are relative to the file's folder. Throws std::runtime_error with file and line, and for
/// a file without images. By group, then by line; times are in the file's own unit.
[[nodiscard]] std::vector<std::vector<Stamped>> read_stamped_lists(const std::filesystem::path& file,
                                                                   std::size_t groups);

/// Units a second of whole numbers that are times: 1, 1e3, 1e6 or 1e9, by their median step as
/// numbering_of() decides it; 1 where some are no whole numbers.
[[nodiscard]] double units_per_second(const std::vector<Stamped>& list);
void divide_times(std::vector<Stamped>& list, double units_per_second);

}  // namespace cairn
