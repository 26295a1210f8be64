// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

/// A file in an archive; a folder where its name ends with a slash.
struct ZipEntry {
  std::string name, bytes;
  bool stored = false;  // as it is, not deflated
  bool link = false;    // to what its bytes name
  std::string password;
};
void write_zip(const std::filesystem::path& archive, const std::vector<ZipEntry>& entries);

}  // namespace cairn
