// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Options that take numbers: every one of them is made here, so that all read units, refuse what is not finite or out
// of range, and tell their range in the help.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <type_traits>
#include <utility>

#include "cairn/quantity.hpp"

namespace cairn::apps {

/// What the check of a number says of itself: `quantity LENGTH 0.002 to 0.2 m`; and the words in its errors.
inline constexpr const char *kQuantity = "quantity", *kNumberIsWanted = "number is wanted";

/// The type below std::optional and std::vector.
template <class T>
struct NumberOf {
  using type = T;
};
template <class T>
requires requires { typename T::value_type; }
struct NumberOf<T> {
  using type = typename T::value_type;
};

/// Reads `2cm` as 0.02. Of whole numbers as decimal ones, without a unit except for memory.
[[nodiscard]] CLI::Validator quantity(const AllowedRange& range, Unit unit, bool is_whole);

/// An option for a number, a std::optional of one, or a std::vector of several.
template <class T>
CLI::Option* add_number(CLI::App& command, const std::string& names, T& value, const AllowedRange& range, Unit unit,
                        const std::string& help) {
  using Number = typename NumberOf<T>::type;
  static_assert(std::is_arithmetic_v<Number> && !std::is_same_v<Number, bool>);
  return command.add_option(names, value, help)->transform(quantity(range, unit, std::is_integral_v<Number>));
}
template <class T>
CLI::Option* add_number(CLI::App& command, const std::string& names, T& value, const AllowedRange& range,
                        const std::string& help) {
  return add_number(command, names, value, range, Unit::none, help);
}

/// LOW:HIGH of --height, metres. Throws CLI::ValidationError.
[[nodiscard]] std::pair<double, double> heights_in(const std::string& text);

/// --device, a Vulkan device.
CLI::Option* add_device(CLI::App& command, int& device);

}  // namespace cairn::apps
