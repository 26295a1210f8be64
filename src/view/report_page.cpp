// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/report_page.hpp"

#include <string>

#include "base/atomic_file.hpp"
#include "cairn/mapping/viewer.hpp"
#include "view/finished_map.hpp"

// The page as built, byte for byte (viewer.html).
__asm__(
    ".section .rodata\n"
    ".global cairn_viewer_page\n.global cairn_viewer_page_end\n"
    "cairn_viewer_page:\n.incbin \"" CAIRN_VIEWER_PAGE "\"\ncairn_viewer_page_end:\n.byte 0\n.previous\n");
extern "C" const char cairn_viewer_page[], cairn_viewer_page_end[];

namespace cairn {
std::string_view viewer_page() {
  return {cairn_viewer_page, static_cast<std::size_t>(cairn_viewer_page_end - cairn_viewer_page)};
}

void write_report_page(const std::filesystem::path& folder) {
  std::string page(viewer_page());
  const PageContent content = FinishedMap(folder).inlined(kMaxReportPage - page.size());
  page.replace(page.find(kDataPlace), kDataPlace.size(), content.first);
  page.replace(page.rfind(kRestPlace), kRestPlace.size(), content.rest);
  write_whole(folder / "report.html", page);
}

}  // namespace cairn
