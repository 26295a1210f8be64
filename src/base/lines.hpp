// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Text files line by line, as words, and the numbers that these hold.
#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace cairn {

/// Calls `take(line number, words)` for each line that is neither empty nor a comment.
void for_each_line(const std::filesystem::path& file,
                   const std::function<void(int, const std::vector<std::string>&)>& take);
/// The number that a word of a line holds; throws with file and line.
[[nodiscard]] double number_of(const std::string& word, const std::filesystem::path& file, int line);
/// Whether a quaternion of a line can be made one of length 1.
[[nodiscard]] inline bool is_rotation(const Eigen::Quaterniond& q) { return q.norm() >= 1e-6 && q.norm() <= 1e6; }

}  // namespace cairn
