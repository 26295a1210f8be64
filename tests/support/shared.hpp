// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Read-only data of many tests, made once for all processes of a build and kept until the program changes. A test that
// modifies the data makes a copy.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

/// Recording made by `cairn synth` with these arguments.
[[nodiscard]] std::filesystem::path shared_recording(const std::vector<std::string>& arguments);

/// Map made by `cairn reconstruct` from a shared recording with these arguments.
[[nodiscard]] std::filesystem::path shared_map(const std::filesystem::path& recording,
                                               const std::vector<std::string>& arguments);

}  // namespace cairn
