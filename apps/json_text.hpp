// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <nlohmann/json.hpp>
#include <string>

namespace cairn::apps {

/// JSON as text. What is not UTF-8 in it, such as a file's name, is shown by replacement characters.
[[nodiscard]] inline std::string text_of(const nlohmann::json& json, int indent = -1) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

/// A message without what the JSON library puts before its own: "[json.exception.type_error.302] ".
[[nodiscard]] inline std::string plain(std::string message) {
  const std::size_t begin = message.find("[json.exception."), end = message.find("] ", begin);
  if (begin != message.npos && end != message.npos) message.erase(begin, end + 2 - begin);
  return message;
}

}  // namespace cairn::apps
