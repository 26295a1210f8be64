// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Conversion of JSON to text, and of text to valid JSON strings.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace cairn {

/// JSON as text. Invalid UTF-8, as in some file names, becomes replacement characters.
[[nodiscard]] std::string text_of(const nlohmann::json& json, int indent = -1);

/// Text with invalid UTF-8 replaced, for use as a JSON string.
[[nodiscard]] std::string as_utf8(const std::string& text);

/// Path as a relative URI (RFC 3986): reserved and non-ASCII bytes are percent-encoded, "%20".
[[nodiscard]] std::string as_uri(const std::string& path);

/// Decodes the path of such a URI.
[[nodiscard]] std::string from_uri(const std::string& uri);

/// Removes the JSON library's prefix, "[json.exception.type_error.302] ", and the quoted bytes of the file, possibly
/// terminal control characters, from a message.
[[nodiscard]] std::string plain(std::string message);

}  // namespace cairn
