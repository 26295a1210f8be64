// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "net/served.hpp"

namespace cairn {

/// The viewer: a self-contained HTML file. It shows the data of its `data` element, or of `data.json` beside it.
[[nodiscard]] std::string_view viewer_page();
inline constexpr std::string_view kDataPlace = "<!-- data -->";  // in the page, before its script
inline constexpr std::string_view kRestPlace = "<!-- rest -->";  // after its script, which runs before they arrive

/// The viewer for a server. `preloaded`: URLs to preload while the script is parsed.
[[nodiscard]] inline Served viewer_file(const std::vector<std::string>& preloaded = {}) {
  std::string page(viewer_page()), links;
  for (const std::string& url : preloaded)
    links += R"(<link rel="preload" as="fetch" crossorigin href=")" + url + "\">";
  page.replace(page.find(kDataPlace), kDataPlace.size(), links);
  return {.content_type = "text/html; charset=utf-8", .body = std::move(page), .is_packable = true};
}

}  // namespace cairn
