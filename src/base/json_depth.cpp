// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/json_depth.hpp"

#include <fmt/format.h>

#include "base/json_scan.hpp"

namespace cairn {

void check_json_depth(std::string_view text) {
  int depth = 0;
  for_each_outside_strings(text, [&](std::size_t i) {
    const char c = text[i];
    if ((c == '[' || c == '{') && ++depth > kMaxJsonDepth)
      throw TooDeepJson(fmt::format("its JSON is nested deeper than {} levels at byte {}", kMaxJsonDepth, i));
    if (c == ']' || c == '}') --depth;
  });
}

}  // namespace cairn
