// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cctype>
#include <filesystem>
#include <string>

namespace cairn {

/// File extension in lower case, with its dot: ".glb" for X.glb and X.GLB.
[[nodiscard]] inline std::string extension_of(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

}  // namespace cairn
