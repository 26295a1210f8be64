// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/words.hpp"

namespace cairn {

std::string shown(std::string_view text) {
  constexpr std::size_t kMaxLength = 120;
  std::string shown;
  for (const char c : text.substr(0, kMaxLength)) shown += c >= ' ' && c <= '~' && c != '\'' ? c : '?';
  return text.size() > kMaxLength ? shown + "..." : shown;
}

}  // namespace cairn
