// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string_view>

#include "view/served.hpp"

namespace cairn {

/// The viewer: one HTML file with all that it needs. It shows what is in an element `data` of it, or what `data.json`
/// beside it tells.
[[nodiscard]] std::string_view viewer_page();
/// The same for a server.
[[nodiscard]] inline Served viewer_file() {
  return {.content_type = "text/html; charset=utf-8", .body = std::string(viewer_page()), .is_packable = true};
}

}  // namespace cairn
