// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "options/yaml_file.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "base/read_whole.hpp"

namespace cairn {

YAML::Node read_yaml_file(const std::filesystem::path& file) {
  const auto bytes = read_whole(file, kMaxYamlSize);
  return read_yaml_text(std::string(bytes.begin(), bytes.end()));
}

YAML::Node read_yaml_text(std::string text) {
  if (text.size() > kMaxYamlSize)
    throw std::runtime_error(fmt::format("has {} bytes, allowed: {}", text.size(), kMaxYamlSize));
  if (text.starts_with("%YAML")) text.erase(0, text.find('\n'));
  return YAML::Load(text);
}

}  // namespace cairn
