// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Parsers of untrusted JSON with bounded depth: the only caller of the JSON library's parser.
#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

#include "base/json_depth.hpp"

namespace cairn {

/// Parses JSON text. Throws nlohmann::json::parse_error for malformed text, and TooDeepJson for text nested deeper than
/// kMaxJsonDepth.
[[nodiscard]] nlohmann::json parsed_json(std::string_view text);
[[nodiscard]] nlohmann::json parsed_json(std::span<const std::uint8_t> bytes);

/// Throws std::runtime_error for JSON text with more than `max_values` values. A value takes up to 56 bytes of memory,
/// an empty array three bytes of text.
void check_json_values(std::string_view text, std::size_t max_values);

/// As parsed_json, but returns a value with is_discarded() for malformed or too deep text.
[[nodiscard]] nlohmann::json parsed_json_or_none(std::string_view text);

/// Parses CBOR with at most 16 levels. Throws nlohmann::json::parse_error for malformed bytes, and std::runtime_error
/// for deeper nesting.
[[nodiscard]] nlohmann::json parsed_cbor(const std::string& bytes);

}  // namespace cairn
