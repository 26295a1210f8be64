// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/atomic_file.hpp"

#include <unistd.h>

#include <fstream>
#include <stdexcept>
#include <string>

namespace cairn {

void write_whole(const std::filesystem::path& file,
                 const std::function<void(const std::filesystem::path& temporary)>& write) {
  namespace fs = std::filesystem;
  // The extension stays last: some writers choose their format by it.
  const fs::path temporary =
      file.parent_path() / ("." + file.stem().string() + "." + std::to_string(getpid()) + file.extension().string());
  std::error_code ignored;
  try {
    if (!std::ofstream(temporary)) throw std::runtime_error("the folder is missing or not writable");
    write(temporary);
    fs::rename(temporary, file);
  } catch (const std::exception& error) {
    fs::remove(temporary, ignored);
    throw std::runtime_error("cannot write " + file.string() + ": " + error.what());
  }
}

}  // namespace cairn
