// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What many tests read, made once for all processes of a build and kept until the program changes. Nobody writes there:
// a test that does takes a copy.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

/// The recording that `cairn synth` makes of these arguments.
[[nodiscard]] std::filesystem::path shared_recording(const std::vector<std::string>& arguments);

/// What `cairn reconstruct` makes of a shared recording with these arguments.
[[nodiscard]] std::filesystem::path shared_map(const std::filesystem::path& recording,
                                               const std::vector<std::string>& arguments);

}  // namespace cairn
