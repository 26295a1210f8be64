// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/report_page.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/viewer.hpp"
#include "support/files.hpp"
#include "support/meshes.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;

class ReportPage : public testing::Test {
 protected:
  ReportPage() { write_text(folder / "report.json", R"({"mesh": {}})"); }
  [[nodiscard]] std::string page() const {
    write_report_page(folder.path());
    EXPECT_LE(std::filesystem::file_size(folder / "report.html"), kMaxReportPage);
    return read_bytes(folder / "report.html");
  }
  static Json data_of(const std::string& page) {
    const std::string mark = "id=\"data\">";
    const std::size_t begin = page.find(mark) + mark.size();
    return Json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  }
  static bool has_file(const std::string& page, const std::string& name) {
    return page.find("data-of=\"" + name + "\">") != std::string::npos;
  }
  TemporaryFolder folder;
};

TEST_F(ReportPage, ShowsAPreviewInsteadOfAMeshThatIsTooLarge) {
  write_text(folder / "mesh.glb", "the mesh itself");
  EXPECT_NE(page().find("dGhlIG1lc2ggaXRzZWxm"), std::string::npos);  // in base64

  std::filesystem::resize_file(folder / "mesh.glb", kMaxReportPage);
  EXPECT_TRUE(data_of(page()).contains("mesh_left_out"));  // no mesh in the file

  write_text(folder / "preview.glb", "a preview");
  EXPECT_NE(page().find("YSBwcmV2aWV3"), std::string::npos);
  EXPECT_LT(std::filesystem::file_size(folder / "report.html"), 2u << 20);
}

TEST_F(ReportPage, HasItsCoarseMeshBeforeTheScriptAndTheRestAfter) {
  write_text(folder / "report.json", R"({"mesh": {"triangles": 200000}})");
  write_mesh(folder / "mesh.glb", noisy_grid(100, 64));
  const std::string text = page();
  const Json data = data_of(text);
  EXPECT_EQ(data["first"], "#first");
  EXPECT_EQ(data["mesh"], "#mesh");
  EXPECT_EQ(data["mesh_bytes"], std::filesystem::file_size(folder / "mesh.glb"));
  EXPECT_LT(text.find("id=\"data\""), text.find("data-of=\"first\""));
  const std::size_t script = text.find("<script>");
  EXPECT_LT(text.find("data-of=\"first\""), script);
  EXPECT_GT(text.find("data-of=\"mesh\""), script);
}

TEST_F(ReportPage, IsBoundedForLargeTexturesAndLongRuns) {
  constexpr std::size_t kFrames = 20'000, kLost = 12'345;
  Json report{{"mesh", {{"triangles", 500'000}}}, {"per_frame", Json::array()}, {"loops", Json::array()}};
  std::string path;
  for (std::size_t i = 0; i < kFrames; ++i) {
    const double time = 0.1 * static_cast<double>(i);
    report["per_frame"].push_back(
        {{"index", i}, {"state", i == kLost ? "lost" : "ok"}, {"text", std::string(300, 'x')}});
    report["loops"].push_back({{"from", time}, {"to", time}, {"inlier", true}});
    path += std::to_string(time) + " 0 0 0 0 0 0 1\n";
  }
  write_text(folder / "report.json", report.dump());
  write_text(folder / "trajectory.txt", path);
  write_mesh(folder / "mesh.glb", noisy_grid(300, 3072));
  EXPECT_GT(std::filesystem::file_size(folder / "mesh.glb"), kMaxReportPage);
  const std::string text = page();
  for (const char* name : {"first", "mesh"}) EXPECT_TRUE(has_file(text, name)) << name;
  const Json data = data_of(text);
  EXPECT_LE(data["trajectory"].size(), 2048u);
  EXPECT_LE(data["report"]["loops"].size(), 2048u);
  const Json& frames = data["report"]["per_frame"];
  EXPECT_LE(frames.size(), 2048u);
  EXPECT_GT(frames.size(), 1024u);
  EXPECT_EQ(std::count_if(frames.begin(), frames.end(), [](const Json& frame) { return frame["state"] == "lost"; }), 1);
  EXPECT_EQ(text, page());
}

}  // namespace
}  // namespace cairn
