// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/report_page.hpp"

#include <gtest/gtest.h>

#include "cairn/mapping/viewer.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

TEST(ReportPage, ShowsAPreviewInsteadOfAMeshThatIsTooLarge) {
  const TemporaryFolder folder;
  write_text(folder / "report.json", R"({"mesh": {}})");
  write_text(folder / "mesh.glb", "the mesh itself");
  write_report_page(folder.path());
  EXPECT_NE(read_bytes(folder / "report.html").find("dGhlIG1lc2ggaXRzZWxm"), std::string::npos);  // in base64

  std::filesystem::resize_file(folder / "mesh.glb", kMaxInlineMesh + 1);
  write_report_page(folder.path());
  EXPECT_NE(read_bytes(folder / "report.html").find("mesh_left_out\":"), std::string::npos);

  write_text(folder / "preview.glb", "a preview");
  write_report_page(folder.path());
  EXPECT_NE(read_bytes(folder / "report.html").find("YSBwcmV2aWV3"), std::string::npos);
  EXPECT_LT(std::filesystem::file_size(folder / "report.html"), 2u << 20);
}

}  // namespace
}  // namespace cairn
