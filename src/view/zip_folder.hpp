// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

namespace cairn {

/// Packs the files of a folder into a zip file under their file names, atomically. Throws std::runtime_error with the
/// reason.
void zip_folder(const std::filesystem::path& folder, const std::filesystem::path& file);

}  // namespace cairn
