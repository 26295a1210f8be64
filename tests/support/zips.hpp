// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

/// File in an archive; a folder if its name ends with a slash.
struct ZipEntry {
  std::string name, bytes;
  bool stored = false;  // not deflated
  bool link = false;    // symbolic link to the path in `bytes`
  std::string password;
};
void write_zip(const std::filesystem::path& archive, const std::vector<ZipEntry>& entries);

}  // namespace cairn
