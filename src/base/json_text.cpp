// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/json_text.hpp"

#include <cctype>
#include <charconv>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/read_json.hpp"

namespace cairn {

std::string text_of(const nlohmann::json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string as_utf8(const std::string& text) { return parsed_json(text_of(text)).get<std::string>(); }

std::string as_uri(const std::string& path) {
  constexpr std::string_view kDigits = "0123456789ABCDEF", kPlain = "-._~/";
  std::string uri;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 128 && std::isalnum(byte) != 0) || kPlain.find(c) != std::string_view::npos)
      uri += c;
    else
      uri += {'%', kDigits[byte >> 4], kDigits[byte & 15]};
  }
  return uri;
}

std::string from_uri(const std::string& uri) {
  std::string path;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    unsigned char byte = 0;
    const char* digits = uri.data() + i + 1;
    if (uri[i] == '%' && i + 2 < uri.size() && std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2) {
      path += static_cast<char>(byte);
      i += 2;
    } else {
      path += uri[i];
    }
  }
  return path;
}

std::string plain(std::string message) {
  const std::size_t begin = message.find("[json.exception."), end = message.find("] ", begin);
  if (begin != message.npos && end != message.npos) message.erase(begin, end + 2 - begin);
  if (const std::size_t bytes = message.find("; last read: "); bytes != message.npos) message.resize(bytes);
  return message;
}

}  // namespace cairn
