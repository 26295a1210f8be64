// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cell_option.hpp"

#include <cstdlib>
#include <sstream>
#include <utility>

#include "cairn/quantity.hpp"

namespace cairn::apps {
namespace {

std::array<int, 3> parse_cell(const std::string& text) {
  constexpr long long kFarthest = 1'000'000;  // cells
  std::array<int, 3> cell{};
  std::istringstream parts(text);
  std::size_t count = 0;
  bool is_right = !text.ends_with(',');
  for (std::string part; std::getline(parts, part, ','); ++count) {
    const auto value = parse_whole(part);
    is_right = is_right && count < cell.size() && value && std::abs(*value) <= kFarthest;
    if (is_right) cell[count] = static_cast<int>(*value);
  }
  if (!is_right || count != cell.size())
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
