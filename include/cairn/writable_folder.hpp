// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

namespace cairn {

/// Throws std::runtime_error like write_whole where no file can be made in a folder. No file that is there is touched.
void expect_writable(const std::filesystem::path& folder);

}  // namespace cairn
