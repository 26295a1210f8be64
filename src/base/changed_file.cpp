// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/changed_file.hpp"

#include <algorithm>
#include <cstdint>

#include "base/read_whole.hpp"

namespace cairn {

bool write_changed(const std::filesystem::path& file, std::string_view text, Durable durable) {
  std::error_code ignored;
  if (std::filesystem::is_regular_file(file, ignored) &&
      std::ranges::equal(read_whole(file), text, {}, {}, [](char c) { return static_cast<std::uint8_t>(c); }))
    return false;
  write_whole(file, text, durable);
  return true;
}

}  // namespace cairn
