// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Replaces report_page.cpp if the library is built without the viewer: no report.html and no served page.
#include <stdexcept>

#include "cairn/mapping/viewer.hpp"
#include "view/report_page.hpp"

namespace cairn {
namespace {

[[noreturn]] void no_viewer() {
  throw std::runtime_error("this build has no viewer: build with CAIRN_VIEWER=ON, which needs npm");
}

}  // namespace

std::string_view viewer_page() { no_viewer(); }
void write_report_page(const std::filesystem::path&) {}

}  // namespace cairn
