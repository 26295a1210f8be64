// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/json_text.hpp"

#include <nlohmann/json.hpp>

namespace cairn {

std::string text_of(const nlohmann::json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string as_utf8(const std::string& text) { return nlohmann::json::parse(text_of(text)).get<std::string>(); }

std::string plain(std::string message) {
  const std::size_t begin = message.find("[json.exception."), end = message.find("] ", begin);
  if (begin != message.npos && end != message.npos) message.erase(begin, end + 2 - begin);
  return message;
}

}  // namespace cairn
