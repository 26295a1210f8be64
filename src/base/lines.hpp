// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Text files, line by line, with parsing of numbers.
#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace cairn {

/// Calls `take(line number, words)` for each line except empty lines and comments. Throws std::runtime_error for a file
/// that cannot be read, and for a line of more than 65,536 characters.
void for_each_line(const std::filesystem::path& file,
                   const std::function<void(int, const std::vector<std::string>&)>& take);
/// Parses a number; throws with file and line.
[[nodiscard]] double number_of(const std::string& word, const std::filesystem::path& file, int line);
/// True if a quaternion from a file can be normalized.
[[nodiscard]] inline bool is_rotation(const Eigen::Quaterniond& q) { return q.norm() >= 1e-6 && q.norm() <= 1e6; }

}  // namespace cairn
