// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "options/yaml_file.hpp"

#include <string>

#include "base/read_whole.hpp"

namespace cairn {

YAML::Node read_yaml_file(const std::filesystem::path& file) {
  const auto bytes = read_whole(file, kMaxYamlSize);
  std::string text(bytes.begin(), bytes.end());
  if (text.starts_with("%YAML")) text.erase(0, text.find('\n'));
  return YAML::Load(text);
}

}  // namespace cairn
