// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "quantity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace cairn::apps {
namespace {

constexpr int kMostDevices = 63;

std::string placeholder_of(Unit unit, bool is_whole) {
  switch (unit) {
    case Unit::metres:
      return "LENGTH";
    case Unit::square_metres:
      return "AREA";
    case Unit::seconds:
      return "TIME";
    case Unit::bytes:
    case Unit::mebibytes:
      return "SIZE";
    default:
      return is_whole ? "N" : "NUMBER";
  }
}

/// Parses an integer without rounding; memory sizes are rounded down to the unit.
std::optional<std::string> as_whole(const std::string& word, const AllowedRange& range, Unit unit) {
  if (unit == Unit::bytes || unit == Unit::mebibytes) {
    const auto value = parse_quantity(word, unit);
    return value && range.has(std::floor(*value)) ? std::optional(fmt::format("{:.0f}", std::floor(*value)))
                                                  : std::nullopt;
  }
  // Parsed as digits, since a double would lose precision.
  const auto bare = unit == Unit::pixels && word.ends_with("px") ? word.substr(0, word.size() - 2) : word;
  const auto value = parse_whole(bare);
  return value && range.has(static_cast<double>(*value)) ? std::optional(fmt::format("{}", *value)) : std::nullopt;
}

std::optional<std::string> as_number(const std::string& word, const AllowedRange& range, Unit unit) {
  const auto value = parse_quantity(word, unit);
  return value && range.has(*value) ? std::optional(fmt::format("{}", *value)) : std::nullopt;
}

}  // namespace

CLI::Validator quantity(const AllowedRange& range, Unit unit, bool is_whole) {
  const std::string words = words_of(range, unit), examples = examples_of(unit);
  return CLI::Validator(
      [=](std::string& word) -> std::string {
        if (auto number = is_whole ? as_whole(word, range, unit) : as_number(word, range, unit)) {
          word = *std::move(number);
          return {};
        }
        std::string wanted = word + ": a " + (is_whole ? "whole " : "") + kNumberIsWanted;
        for (const std::string& more : {words, examples})
          if (!more.empty()) wanted += ", " + more;
        return wanted;
      },
      fmt::format("{} {} {}", kQuantity, placeholder_of(unit, is_whole), words));
}

std::pair<double, double> heights_in(const std::string& text) {
  constexpr double kHighest = 1e4;  // meters
  const std::size_t colon = std::min(text.find(':'), text.size());
  const auto low = parse_quantity(text.substr(0, colon), Unit::metres),
             high = colon < text.size() ? parse_quantity(text.substr(colon + 1), Unit::metres) : std::nullopt;
  if (!low || !high || !(*low < *high) || *low < -kHighest || *high > kHighest)
    throw CLI::ValidationError("--height", "'" + text + "' is not LOW:HIGH, for example -1.2:0.3 or -120cm:30cm");
  return {*low, *high};
}

CLI::Option* add_device(CLI::App& command, int& device) {
  return add_number(command, "--device", device, {-1, kMostDevices},
                    "Vulkan device as `cairn devices` numbers them; -1 chooses")
      ->capture_default_str();
}

}  // namespace cairn::apps
