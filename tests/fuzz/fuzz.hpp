// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Shared code of the fuzz targets. A target passes bytes to a reader, which returns a usable value or throws a
// std::runtime_error with a readable message; any other result ends the process, and libFuzzer keeps the input.
#pragma once
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace cairn::fuzz {

/// Folder of this process, for readers of paths; the campaign puts it in memory.
inline const std::filesystem::path& folder() {
  static const std::filesystem::path folder = [] {
    auto made = std::filesystem::temp_directory_path() / ("cairn-fuzz-" + std::to_string(getpid()));
    std::filesystem::create_directories(made);
    std::atexit([] {
      std::error_code ignored;
      std::filesystem::remove_all(std::filesystem::temp_directory_path() / ("cairn-fuzz-" + std::to_string(getpid())),
                                  ignored);
    });
    return made;
  }();
  return folder;
}

inline std::filesystem::path file_of(const std::string& name, std::string_view bytes) {
  auto file = folder() / name;
  std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return file;
}

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// Ends the process unless `read` returns or throws a one-line message without the tags of libraries.
template <class Read>
void expect_value_or_plain_error(const Read& read) {
  try {
    read();
  } catch (const std::runtime_error& error) {
    // Words in quotes are from the file. The tag is compared letter by letter: the fuzzer learns entire words from
    // comparisons, and would insert them.
    constexpr std::string_view kTag = "json.exception";
    std::string said;
    bool quoted = false, is_plain = *error.what() != '\0';
    for (const char c : std::string_view(error.what())) {
      is_plain &= c >= ' ' && c != 127;
      quoted ^= c == '\'' || c == '`';
      if (!quoted) said += c;
    }
    const auto same = [](char a, char b) { return a == b; };
    if (is_plain && std::search(said.begin(), said.end(), kTag.begin(), kTag.end(), same) == said.end()) return;
    std::fprintf(stderr, "not a line for a user: %s\n", error.what());
    std::abort();
  }
}

/// Keeps the values from being optimized away, and touches all of them for the address sanitizer.
template <class Numbers>
void touch(const Numbers& numbers) {
  [[maybe_unused]] static volatile double sink;
  double sum = 0;
  for (const auto& number : numbers) sum += static_cast<double>(number);
  sink = sum;
}

}  // namespace cairn::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
