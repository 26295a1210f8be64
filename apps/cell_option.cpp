// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cell_option.hpp"

#include <cstdio>
#include <utility>

namespace cairn::apps {
namespace {

std::array<int, 3> parse_cell(const std::string& text) {
  std::array<int, 3> cell{};
  int end = 0;
  if (std::sscanf(text.c_str(), "%d,%d,%d%n", &cell[0], &cell[1], &cell[2], &end) != 3 ||
      static_cast<std::size_t>(end) != text.size())
    throw CLI::ValidationError("--cell",
                               "'" + text + "' is not X,Y,Z, as PLAN/cells names its files, for example 0,-1,2");
  return cell;
}

}  // namespace

CLI::Option* add_cell(CLI::App& command, std::function<void(const std::array<int, 3>&)> take,
                      const std::string& description) {
  return command
      .add_option_function<std::string>(
          "--cell", [take = std::move(take)](const std::string& text) { take(parse_cell(text)); }, description)
      ->type_name("X,Y,Z");
}

}  // namespace cairn::apps
