// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <charconv>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>

namespace cairn::apps {

/// A number that was a float, as people wrote it: 0.01, not 0.009999999776482582.
[[nodiscard]] inline double as_written(double value) {
  const auto single = static_cast<float>(value);
  if (static_cast<double>(single) != value || value == std::trunc(value)) return value;  // more than that, or whole
  char text[32];
  const auto end = std::to_chars(std::begin(text), std::end(text), single).ptr;
  double written = value;
  return std::from_chars(std::begin(text), end, written).ec == std::errc() ? written : value;
}

/// JSON as text for people. What is not UTF-8 in it, such as a file's name, is shown by replacement characters.
template <class Json>
[[nodiscard]] std::string text_of(Json json, int indent = -1) {
  const auto tidy = [](auto& node, const auto& again) -> void {
    if (node.is_number_float()) node = as_written(node.template get<double>());
    if (node.is_structured())
      for (auto& child : node) again(child, again);
  };
  tidy(json, tidy);
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}
/// The same for what is written down in braces.
[[nodiscard]] inline std::string text_of(const nlohmann::json& json, int indent = -1) {
  return text_of<nlohmann::json>(json, indent);
}

/// A message without what the JSON library puts before its own: "[json.exception.type_error.302] ".
[[nodiscard]] inline std::string plain(std::string message) {
  const std::size_t begin = message.find("[json.exception."), end = message.find("] ", begin);
  if (begin != message.npos && end != message.npos) message.erase(begin, end + 2 - begin);
  return message;
}

}  // namespace cairn::apps
