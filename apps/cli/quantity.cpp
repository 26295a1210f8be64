// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/quantity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace cairn::apps {
namespace {

constexpr int kMaxDevice = 63;

std::string placeholder_of(Unit unit, bool is_whole) {
  switch (unit) {
    case Unit::meters:
      return "LENGTH";
    case Unit::square_meters:
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
std::optional<std::string> parse_integer(const std::string& value_text, const AllowedRange& range, Unit unit) {
  if (unit == Unit::bytes || unit == Unit::mebibytes) {
    const auto value = parse_quantity(value_text, unit);
    return value && range.has(std::floor(*value)) ? std::optional(fmt::format("{:.0f}", std::floor(*value)))
                                                  : std::nullopt;
  }
  // Parsed as digits, since a double would lose precision.
  const auto bare =
      unit == Unit::pixels && value_text.ends_with("px") ? value_text.substr(0, value_text.size() - 2) : value_text;
  const auto value = parse_whole(bare);
  return value && range.has(static_cast<double>(*value)) ? std::optional(fmt::format("{}", *value)) : std::nullopt;
}

std::optional<std::string> parse_real(const std::string& value_text, const AllowedRange& range, Unit unit) {
  const auto value = parse_quantity(value_text, unit);
  return value && range.has(*value) ? std::optional(fmt::format("{}", *value)) : std::nullopt;
}

}  // namespace

CLI::Validator quantity(const AllowedRange& range, Unit unit, bool is_whole) {
  const std::string range_text = words_of(range, unit), examples = examples_of(unit);
  return CLI::Validator(
      [=](std::string& value_text) -> std::string {
        if (auto number = is_whole ? parse_integer(value_text, range, unit) : parse_real(value_text, range, unit)) {
          value_text = *std::move(number);
          return {};
        }
        std::string error = value_text + ": " + (is_whole ? "whole " : "") + kNumberExpected;
        for (const std::string& more : {range_text, examples})
          if (!more.empty()) error += ", " + more;
        return error;
      },
      fmt::format("{} {} {}", kQuantity, placeholder_of(unit, is_whole), range_text));
}

std::pair<double, double> heights_in(const std::string& text) {
  constexpr double kMaxHeight = 1e4;  // meters
  const std::size_t colon = std::min(text.find(':'), text.size());
  const auto low = parse_quantity(text.substr(0, colon), Unit::meters),
             high = colon < text.size() ? parse_quantity(text.substr(colon + 1), Unit::meters) : std::nullopt;
  if (!low || !high || !(*low < *high) || *low < -kMaxHeight || *high > kMaxHeight)
    throw CLI::ValidationError("--height", "'" + text + "' is not LOW:HIGH, for example -1.2:0.3 or -120cm:30cm");
  return {*low, *high};
}

CLI::Option* add_device(CLI::App& command, int& device) {
  return add_number(command, "--device", device, {-1, kMaxDevice},
                    "Vulkan device by its number in `cairn devices`; -1: automatic")
      ->capture_default_str();
}

}  // namespace cairn::apps
