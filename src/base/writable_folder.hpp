// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

namespace cairn {

/// Throws std::runtime_error, as write_whole does, if no file can be created in a folder. Existing files stay
/// unchanged.
void expect_writable(const std::filesystem::path& folder);

}  // namespace cairn
