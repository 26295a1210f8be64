// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/quantity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <span>

namespace cairn {
namespace {

/// Name of a unit, with its conversion to the base unit: 10^power * factor.
struct Name {
  std::string_view name;
  int power = 0;
  double factor = 1;
};

constexpr double kKibi = 1024, kMebi = kKibi * kKibi;

std::span<const Name> names_of(Unit unit) {
  static constexpr Name kNone[] = {{""}};
  static constexpr Name kShare[] = {{""}, {"%", -2}};
  static constexpr Name kLength[] = {{""},       {"m"},      {"dm", -1}, {"cm", -2},
                                     {"mm", -3}, {"um", -6}, {"µm", -6}, {"km", 3}};
  static constexpr Name kArea[] = {{""},        {"m2"},      {"m²"},      {"dm2", -2}, {"dm²", -2},
                                   {"cm2", -4}, {"cm²", -4}, {"mm2", -6}, {"mm²", -6}};
  static constexpr Name kTime[] = {{""}, {"s"}, {"ms", -3}, {"us", -6}, {"µs", -6}, {"min", 0, 60}, {"h", 0, 3600}};
  static constexpr Name kAngle[] = {
      {""}, {"rad"}, {"deg", 0, std::numbers::pi / 180}, {"°", 0, std::numbers::pi / 180}};
  static constexpr Name kRate[] = {{""}, {"Hz"}, {"fps"}, {"/s"}};
  static constexpr Name kPixels[] = {{""}, {"px"}};
  static constexpr Name kBytes[] = {{""},
                                    {"B"},
                                    {"kB", 3},
                                    {"MB", 6},
                                    {"GB", 9},
                                    {"TB", 12},
                                    {"KiB", 0, kKibi},
                                    {"MiB", 0, kMebi},
                                    {"GiB", 0, kMebi * kKibi},
                                    {"TiB", 0, kMebi * kMebi}};
  switch (unit) {
    case Unit::none:
      return kNone;
    case Unit::share:
      return kShare;
    case Unit::meters:
      return kLength;
    case Unit::square_meters:
      return kArea;
    case Unit::seconds:
      return kTime;
    case Unit::radians:
      return kAngle;
    case Unit::hertz:
      return kRate;
    case Unit::pixels:
      return kPixels;
    case Unit::bytes:
    case Unit::mebibytes:
      return kBytes;
  }
  return kNone;
}

std::string_view symbol_of(Unit unit) {
  switch (unit) {
    case Unit::none:
    case Unit::share:
      return "";
    case Unit::meters:
      return " m";
    case Unit::square_meters:
      return " m2";
    case Unit::seconds:
      return " s";
    case Unit::radians:
      return " rad";
    case Unit::hertz:
      return " Hz";
    case Unit::pixels:
      return " px";
    case Unit::bytes:
      return " bytes";
    case Unit::mebibytes:
      return " MiB";
  }
  return "";
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

/// Length of the decimal number at the start of the text: 0 for none, and for `nan` and `inf`.
std::size_t length_of_number(std::string_view text) {
  double ignored = 0;
  const std::size_t digit = text.starts_with('-') ? 1 : 0;
  if (text.size() <= digit || (text[digit] != '.' && (text[digit] < '0' || text[digit] > '9'))) return 0;
  return static_cast<std::size_t>(std::from_chars(text.data(), text.data() + text.size(), ignored).ptr - text.data());
}

/// Multiplies by a power of ten before rounding to double, so that the result is exact.
std::optional<double> number_of(std::string_view decimal, int power) {
  const std::size_t exponent = std::min(decimal.find_first_of("eE"), decimal.size());
  int exponent_value = 0;
  if (exponent < decimal.size()) {
    std::string_view digits = decimal.substr(exponent + 1);
    if (digits.starts_with('+')) digits.remove_prefix(1);
    if (std::from_chars(digits.data(), digits.data() + digits.size(), exponent_value).ec != std::errc())
      return std::nullopt;
  }
  const std::string scaled = fmt::format("{}e{}", decimal.substr(0, exponent), exponent_value + power);
  double value = 0;
  if (std::from_chars(scaled.data(), scaled.data() + scaled.size(), value).ec != std::errc()) return std::nullopt;
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

std::string_view without_plus(std::string_view text) {
  text = trimmed(text);
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  return text;
}

std::string shown(double value) {
  constexpr double kExact = 9e15;
  const bool is_whole = std::abs(value) < kExact && value == std::floor(value);
  return is_whole ? fmt::format("{}", static_cast<long long>(value)) : fmt::format("{}", value);
}

}  // namespace

std::optional<double> parse_quantity(std::string_view text, Unit unit) {
  text = without_plus(text);
  const std::size_t end = length_of_number(text);
  if (end == 0) return std::nullopt;
  const std::string_view name = trimmed(text.substr(end));
  for (const Name& known : names_of(unit)) {
    if (known.name != name) continue;
    const auto value = number_of(text.substr(0, end), known.power);
    if (!value) return std::nullopt;
    const bool is_converted = unit == Unit::mebibytes && !name.empty();
    const double converted = *value * known.factor / (is_converted ? kMebi : 1.0);
    return std::isfinite(converted) ? std::optional(converted) : std::nullopt;
  }
  return std::nullopt;
}

std::optional<long long> parse_whole(std::string_view text) {
  text = without_plus(text);
  long long value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

bool AllowedRange::has(double value) const {
  return std::isfinite(value) && (is_open ? value > min : value >= min) && value <= max;
}

bool AllowedRange::has(float value) const {
  const auto low = static_cast<float>(min), high = static_cast<float>(max);
  return std::isfinite(value) && (is_open ? value > low : value >= low) && value <= high;
}

std::string words_of(const AllowedRange& range, Unit unit) {
  const std::string_view symbol = symbol_of(unit);
  const bool has_max = std::isfinite(range.max);
  if (!std::isfinite(range.min)) return has_max ? fmt::format("{}{} or less", shown(range.max), symbol) : "";
  if (range.is_open && has_max)
    return fmt::format("more than {}, at most {}{}", shown(range.min), shown(range.max), symbol);
  if (range.is_open) return fmt::format("more than {}{}", shown(range.min), symbol);
  if (!has_max) return fmt::format("{}{} or more", shown(range.min), symbol);
  return fmt::format("{} to {}{}", shown(range.min), shown(range.max), symbol);
}

std::string examples_of(Unit unit) {
  switch (unit) {
    case Unit::none:
    case Unit::pixels:
      return "";
    case Unit::share:
      return "for example 0.5 or 50%";
    case Unit::meters:
      return "for example 0.02, 2cm or 20mm";
    case Unit::square_meters:
      return "for example 0.03 or 300cm2";
    case Unit::seconds:
      return "for example 0.5, 500ms or 2min";
    case Unit::radians:
      return "for example 0.5 or 30deg";
    case Unit::hertz:
      return "for example 30 or 30Hz";
    case Unit::bytes:
      return "for example 512MiB";
    case Unit::mebibytes:
      return "for example 512 or 2GiB";
  }
  return "";
}

}  // namespace cairn
