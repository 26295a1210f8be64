// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Parser of untrusted YAML files with bounded size: the only caller of the YAML library's parser.
#pragma once
#include <yaml-cpp/yaml.h>

#include <cstddef>
#include <filesystem>
#include <string>

namespace cairn {

/// Maximum size in bytes of a YAML file. The library takes up to 300 bytes of memory per byte of text.
constexpr std::size_t kMaxYamlSize = std::size_t{128} << 10;

/// Parses a YAML file, also with OpenCV's first line `%YAML:1.0`. Throws YAML::Exception for malformed text, and
/// std::runtime_error for a file that cannot be read or is larger than kMaxYamlSize, without the file's name.
[[nodiscard]] YAML::Node read_yaml_file(const std::filesystem::path& file);
/// The same for YAML or JSON text.
[[nodiscard]] YAML::Node read_yaml_text(std::string text);

}  // namespace cairn
