// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// JSON as text that people read, and text as a part of JSON.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace cairn {

/// JSON as text. What is not UTF-8 in it, such as a file's name, is shown by replacement characters.
[[nodiscard]] std::string text_of(const nlohmann::json& json, int indent = -1);

/// The same for a text that becomes a part of JSON.
[[nodiscard]] std::string as_utf8(const std::string& text);

/// A path as a relative URI (RFC 3986): what has a meaning there, or is not ASCII, by its bytes' numbers, "%20".
[[nodiscard]] std::string as_uri(const std::string& path);

/// The path that such a URI tells.
[[nodiscard]] std::string from_uri(const std::string& uri);

/// A message without what the JSON library puts before its own, "[json.exception.type_error.302] ", and without the
/// bytes of the file, which a terminal might obey, behind it.
[[nodiscard]] std::string plain(std::string message);

}  // namespace cairn
