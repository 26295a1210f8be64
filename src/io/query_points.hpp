// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <vector>

namespace cairn {

/// A CSV file with the header x,y,z and three numbers a line (nan is one). Throws std::runtime_error with file and
/// line.
[[nodiscard]] std::vector<Eigen::Vector3f> read_query_points(const std::filesystem::path& file);

}  // namespace cairn
