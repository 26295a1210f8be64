// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <stdexcept>
#include <string_view>

namespace cairn {

/// Maximum nesting of JSON from untrusted files: parsers, copies and destructors recurse once per level.
constexpr int kMaxJsonDepth = 64;

struct TooDeepJson : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Throws TooDeepJson for JSON text with more than kMaxJsonDepth nested objects and arrays. Call it before any parser.
void check_json_depth(std::string_view text);

}  // namespace cairn
