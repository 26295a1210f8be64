// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Numeric options. All are created here, so that all accept units, reject non-finite and out-of-range values, and show
// their range in the help.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <type_traits>
#include <utility>

#include "base/quantity.hpp"

namespace cairn::apps {

/// Description of a numeric check, `quantity LENGTH 0.002 to 0.2 m`, and the phrase in its errors.
inline constexpr const char *kQuantity = "quantity", *kNumberExpected = "number expected";

/// Element type of std::optional and std::vector.
template <class T>
struct NumberOf {
  using type = T;
};
template <class T>
requires requires { typename T::value_type; }
struct NumberOf<T> {
  using type = typename T::value_type;
};

/// Parses `2cm` as 0.02. Integers are decimal and without unit, except memory sizes and pixels.
[[nodiscard]] CLI::Validator quantity(const AllowedRange& range, Unit unit, bool is_whole);

/// Adds an option for a number, a std::optional number, or a std::vector of numbers.
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

/// Parses LOW:HIGH of --height, meters. Throws CLI::ValidationError.
[[nodiscard]] std::pair<double, double> heights_in(const std::string& text);

/// Adds --device, a Vulkan device.
CLI::Option* add_device(CLI::App& command, int& device);

}  // namespace cairn::apps
