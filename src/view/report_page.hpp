// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "view/served.hpp"

namespace cairn {

/// The viewer: one HTML file with all that it needs. It shows what is in an element `data` of it, or what `data.json`
/// beside it tells.
[[nodiscard]] std::string_view viewer_page();
inline constexpr std::string_view kDataPlace = "<!-- data -->";  // in the page, before its script

/// The same for a server. `soon`: what is beside it and wanted first; it is fetched while the script is read.
[[nodiscard]] inline Served viewer_file(const std::vector<std::string>& soon = {}) {
  std::string page(viewer_page()), links;
  for (const std::string& url : soon) links += R"(<link rel="preload" as="fetch" crossorigin href=")" + url + "\">";
  page.replace(page.find(kDataPlace), kDataPlace.size(), links);
  return {.content_type = "text/html; charset=utf-8", .body = std::move(page), .is_packable = true};
}

}  // namespace cairn
