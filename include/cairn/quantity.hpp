// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Numbers as people write them, with a unit or without one.
#pragma once
#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace cairn {

/// The unit of a number that is written without one, which parse_quantity gives numbers in.
enum class Unit { none, share, metres, square_metres, seconds, radians, hertz, pixels, bytes, mebibytes };

/// The number of `0.02`, `2cm`, `20 mm`, `500ms`, `2GiB`, `50%`: exact, as decimal numbers are. Nothing for what is no
/// number, is not finite, is too large for a double, or has another kind of unit.
[[nodiscard]] std::optional<double> parse_quantity(std::string_view text, Unit unit = Unit::none);
/// The same without a fraction and a unit.
[[nodiscard]] std::optional<long long> parse_whole(std::string_view text);

/// The values that an option may have.
struct AllowedRange {
  double least = -std::numeric_limits<double>::infinity(), most = std::numeric_limits<double>::infinity();
  bool is_open = false;  ///< `least` itself is not allowed

  /// False for what is not finite.
  [[nodiscard]] bool has(double value) const;
  /// By the bounds as the type rounds them: 0.2f is 0.2.
  [[nodiscard]] bool has(float value) const;
};

/// "0.002 to 0.2 m", "more than 0", "0 s or more".
[[nodiscard]] std::string words_of(const AllowedRange& range, Unit unit = Unit::none);
/// How the unit can be written: "for example 0.02, 2cm or 20mm"; empty without one.
[[nodiscard]] std::string examples_of(Unit unit);

}  // namespace cairn
