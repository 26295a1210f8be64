// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Numbers in user input, with or without a unit.
#pragma once
#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace cairn {

/// Default unit of a number written without one, and the unit of parse_quantity's result.
enum class Unit { none, share, meters, square_meters, seconds, radians, hertz, pixels, bytes, mebibytes };

/// Parses `0.02`, `2cm`, `20 mm`, `500ms`, `2GiB`, `50%` with exact decimal conversion. Returns nullopt for text that
/// is not a finite number, is too large for a double, or has a unit of another kind.
[[nodiscard]] std::optional<double> parse_quantity(std::string_view text, Unit unit = Unit::none);
/// Parses an integer without a unit.
[[nodiscard]] std::optional<long long> parse_whole(std::string_view text);

/// Allowed range of an option.
struct AllowedRange {
  double min = -std::numeric_limits<double>::infinity(), max = std::numeric_limits<double>::infinity();
  bool is_open = false;  ///< true: `min` itself is not allowed

  /// False for values that are not finite.
  [[nodiscard]] bool has(double value) const;
  /// Compares with the bounds rounded to float: 0.2f is 0.2.
  [[nodiscard]] bool has(float value) const;
};

/// "0.002 to 0.2 m", "more than 0", "0 s or more".
[[nodiscard]] std::string words_of(const AllowedRange& range, Unit unit = Unit::none);
/// Examples of the unit's notation: "for example 0.02, 2cm or 20mm"; empty for Unit::none.
[[nodiscard]] std::string examples_of(Unit unit);

}  // namespace cairn
