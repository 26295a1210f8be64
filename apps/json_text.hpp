// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <system_error>

#include "cairn/json_depth.hpp"

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

/// Values of JSON from outside. Throws nlohmann::json::exception for malformed text, and std::runtime_error for text
/// nested too deeply.
[[nodiscard]] inline nlohmann::json parsed_json(std::string_view text) {
  check_json_depth(text);
  return nlohmann::json::parse(text);
}

/// The same of a file; a pipe or a device, which may never end, is an empty one.
[[nodiscard]] inline nlohmann::json json_in(const std::filesystem::path& file) {
  std::error_code ignored;
  std::ifstream in;
  if (std::filesystem::is_regular_file(file, ignored)) in.open(file, std::ios::binary);
  return parsed_json(std::string(std::istreambuf_iterator<char>(in), {}));
}

/// A message without what the JSON library puts before its own, "[json.exception.type_error.302] ", and without the
/// bytes of the file, which a terminal might obey, behind it.
[[nodiscard]] inline std::string plain(std::string message) {
  const std::size_t begin = message.find("[json.exception."), end = message.find("] ", begin);
  if (begin != message.npos && end != message.npos) message.erase(begin, end + 2 - begin);
  if (const std::size_t bytes = message.find("; last read: "); bytes != message.npos) message.resize(bytes);
  return message;
}

}  // namespace cairn::apps
