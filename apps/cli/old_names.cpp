// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/old_names.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <string_view>

namespace cairn::apps {
namespace {

struct Renamed {
  std::string_view old_name, name;
};
constexpr std::array<Renamed, 1> kCommands{{{"optimise", "optimize"}}};
constexpr std::array<Renamed, 3> kOptions{
    {{"--colour", "--color"}, {"--colour-delay", "--color-delay"}, {"--metres", "--meters"}}};
constexpr std::array<Renamed, 1> kValues{{{"quantised", "quantized"}}};
constexpr std::array<Renamed, 6> kFields{{{"colour_registered", "color_registered"},
                                          {"colour_camera", "color_camera"},
                                          {"colour_from_depth", "color_from_depth"},
                                          {"with_colour", "with_color"},
                                          {"colour_delay", "color_delay"},
                                          {"metres", "meters"}}};

/// Replaces the first `size` characters of an argument if they are an old name.
template <class Names>
void replace(std::string& argument, std::size_t begin, std::size_t size, const Names& names) {
  for (const Renamed& n : names)
    if (argument.compare(begin, size, n.old_name) == 0) {
      spdlog::warn("{} is now {}; the old name ends with version 0.3", n.old_name, n.name);
      argument.replace(begin, size, n.name);
      return;
    }
}

}  // namespace

std::vector<std::string> with_current_names(std::vector<std::string> arguments) {
  for (std::size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    std::string& argument = arguments[i];
    if (i == 0 || (i == 1 && (arguments[0] == "graph" || arguments[0] == "help")))
      replace(argument, 0, argument.size(), kCommands);
    if (argument.starts_with("--")) {
      replace(argument, 0, std::min(argument.find('='), argument.size()), kOptions);
      const std::size_t value = argument.find('=');
      if (value != argument.npos) replace(argument, value + 1, argument.size(), kValues);
    } else if (i > 0 && arguments[i - 1] == "--compress") {
      replace(argument, 0, argument.size(), kValues);
    }
  }
  return arguments;
}

template <class Json>
void add_old_fields(Json& json) {
  if (!json.is_structured()) return;
  for (auto& value : json) add_old_fields(value);
  if (!json.is_object()) return;
  for (const Renamed& n : kFields)
    if (const auto it = json.find(std::string(n.name)); it != json.end()) json[std::string(n.old_name)] = Json(*it);
}

template void add_old_fields(nlohmann::json&);
template void add_old_fields(nlohmann::ordered_json&);

}  // namespace cairn::apps
