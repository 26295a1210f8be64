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

void write_whole(const std::filesystem::path& file, std::string_view text) {
  write_whole(file, [&](const std::filesystem::path& temporary) {
    std::ofstream out(temporary, std::ios::binary);
    out.write(text.data(), static_cast<std::streamsize>(text.size()));
    if (!out.flush()) throw std::runtime_error("the disk is full");
  });
}

void write_whole(const std::filesystem::path& file, std::span<const std::uint8_t> bytes) {
  write_whole(file, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

}  // namespace cairn
