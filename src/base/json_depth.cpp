// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/json_depth.hpp"

#include <fmt/format.h>

namespace cairn {

void check_json_depth(std::string_view text) {
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') {  // skips to the end of the string
      while (++i < text.size() && text[i] != '"')
        if (text[i] == '\\') ++i;
    } else if (c == '[' || c == '{') {
      if (++depth > kDeepestJson)
        throw TooDeepJson(fmt::format("its JSON is nested deeper than {} levels at byte {}", kDeepestJson, i));
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
}

}  // namespace cairn
