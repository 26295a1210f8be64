// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// JSON files of a map made of segments.
#pragma once
#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "base/json_text.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"

namespace cairn {

/// "kind" and "format" of a file, the message for a file of another kind, and the command to write the file again.
struct JsonKind {
  const char *kind, *mismatch, *remedy;
  int format = 1;
};

/// Parses a file and returns the result of `take`. Throws std::runtime_error with the file's name and the command to
/// write it again, also for exceptions of `take`.
template <class Take>
auto read_json_file(const std::filesystem::path& file, const JsonKind& expected, const Take& take) {
  try {
    const auto bytes = read_whole(file);
    const auto json = parsed_json(bytes);
    if (json.at("kind") != expected.kind) throw std::runtime_error(expected.mismatch);
    if (json.at("format") != expected.format) throw std::runtime_error("was written by another version of Cairn");
    return take(json);
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(
        fmt::format("{}: is damaged ({}); {}", file.string(), plain(error.what()), expected.remedy));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}; {}", file.string(), error.what(), expected.remedy));
  }
}

}  // namespace cairn
