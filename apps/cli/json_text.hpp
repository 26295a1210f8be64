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

#include "base/json_depth.hpp"

namespace cairn::apps {

/// Shortest decimal of a number that was a float: 0.01, not 0.009999999776482582.
[[nodiscard]] inline double shortest_float(double value) {
  const auto single = static_cast<float>(value);
  if (static_cast<double>(single) != value || value == std::trunc(value)) return value;  // no float, or an integer
  char text[32];
  const auto end = std::to_chars(std::begin(text), std::end(text), single).ptr;
  double written = value;
  return std::from_chars(std::begin(text), end, written).ec == std::errc() ? written : value;
}

/// JSON as text for people. Invalid UTF-8, as in file names, becomes replacement characters.
template <class Json>
[[nodiscard]] std::string format_json(Json json, int indent = -1) {
  const auto tidy = [](auto& node, const auto& again) -> void {
    if (node.is_number_float()) node = shortest_float(node.template get<double>());
    if (node.is_structured())
      for (auto& child : node) again(child, again);
  };
  tidy(json, tidy);
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}
/// Overload for brace-initialized JSON.
[[nodiscard]] inline std::string format_json(const nlohmann::json& json, int indent = -1) {
  return format_json<nlohmann::json>(json, indent);
}

/// Parses JSON from outside. Throws nlohmann::json::exception for malformed text and std::runtime_error for text nested
/// too deeply.
[[nodiscard]] inline nlohmann::json parsed_json(std::string_view text) {
  check_json_depth(text);
  return nlohmann::json::parse(text);
}

/// Parses a file. Pipes and devices, which may never end, count as empty.
[[nodiscard]] inline nlohmann::json read_json(const std::filesystem::path& file) {
  std::error_code ignored;
  std::ifstream in;
  if (std::filesystem::is_regular_file(file, ignored)) in.open(file, std::ios::binary);
  return parsed_json(std::string(std::istreambuf_iterator<char>(in), {}));
}

/// Removes the JSON library's prefix "[json.exception.type_error.302] " from a message, and the file's bytes at its
/// end, which could contain terminal escape sequences.
[[nodiscard]] inline std::string strip_json_prefix(std::string message) {
  const std::size_t begin = message.find("[json.exception."), end = message.find("] ", begin);
  if (begin != message.npos && end != message.npos) message.erase(begin, end + 2 - begin);
  if (const std::size_t bytes = message.find("; last read: "); bytes != message.npos) message.resize(bytes);
  return message;
}

}  // namespace cairn::apps
