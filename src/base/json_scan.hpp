// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Scan of JSON text before it is parsed.
#pragma once
#include <cstddef>
#include <string_view>

namespace cairn {

/// Calls `take(index)` for each character outside of strings.
template <class Take>
void for_each_outside_strings(std::string_view text, const Take& take) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '"') {
      take(i);
      continue;
    }
    while (++i < text.size() && text[i] != '"')
      if (text[i] == '\\') ++i;
  }
}

}  // namespace cairn
