// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/cell_option.hpp"

#include <cstdlib>
#include <sstream>
#include <utility>

#include "base/quantity.hpp"

namespace cairn::apps {
namespace {

std::array<int, 3> parse_cell(const std::string& text) {
  constexpr long long kMaxIndex = 1'000'000;  // cells
  std::array<int, 3> cell{};
  std::istringstream parts(text);
  std::size_t count = 0;
  bool is_valid = !text.ends_with(',');
  for (std::string part; std::getline(parts, part, ','); ++count) {
    const auto value = parse_whole(part);
    is_valid = is_valid && count < cell.size() && value && std::abs(*value) <= kMaxIndex;
    if (is_valid) cell[count] = static_cast<int>(*value);
  }
  if (!is_valid || count != cell.size())
    throw CLI::ValidationError("--cell",
                               "'" + text + "' is not X,Y,Z as in the file names of PLAN/cells, for example 0,-1,2");
  return cell;
}

}  // namespace

CLI::Option* add_cell(CLI::App& command, std::function<void(const std::array<int, 3>&)> set_cell,
                      const std::string& description) {
  return command
      .add_option_function<std::string>(
          "--cell", [set_cell = std::move(set_cell)](const std::string& text) { set_cell(parse_cell(text)); },
          description)
      ->type_name("X,Y,Z");
}

}  // namespace cairn::apps
