// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <string>

namespace cairn::plan {

/// Code points of a text in UTF-8, without control characters.
[[nodiscard]] inline std::u32string code_points(const std::string& text) {
  std::u32string points;
  for (std::size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i++]);
    if (first < ' ') continue;
    std::uint32_t code = first < 0x80 ? first : first >= 0xf0 ? first & 7U : first >= 0xe0 ? first & 15U : first & 31U;
    if (first >= 0x80)
      for (; i < text.size() && (static_cast<unsigned char>(text[i]) & 0xc0U) == 0x80U; ++i)
        code = code << 6U | (static_cast<unsigned char>(text[i]) & 63U);
    points += static_cast<char32_t>(code);
  }
  return points;
}

}  // namespace cairn::plan
