// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/report_page.hpp"

#include <boost/archive/iterators/base64_from_binary.hpp>
#include <boost/archive/iterators/transform_width.hpp>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/json_text.hpp"
#include "cairn/atomic_file.hpp"
#include "cairn/trajectory.hpp"
#include "cairn/viewer.hpp"

// The page as the build has made it, byte for byte (viewer.html).
__asm__(
    ".section .rodata\n"
    ".global cairn_viewer_page\n.global cairn_viewer_page_end\n"
    "cairn_viewer_page:\n.incbin \"" CAIRN_VIEWER_PAGE "\"\ncairn_viewer_page_end:\n.byte 0\n.previous\n");
extern "C" const char cairn_viewer_page[], cairn_viewer_page_end[];

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kPlace = "<!-- data -->";  // in the page

std::string read_bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error(file.string() + ": cannot be read; give a folder that cairn has made");
  return {std::istreambuf_iterator<char>(in), {}};
}

nlohmann::json data_of(const fs::path& folder) {
  nlohmann::json trajectory = nlohmann::json::array();
  if (fs::exists(folder / "trajectory.txt"))
    for (const auto& [time, pose] : read_trajectory(folder / "trajectory.txt")) {
      const Eigen::Quaterniond q(pose.linear());
      const Eigen::Vector3d& t = pose.translation();
      trajectory.push_back({time, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()});
    }
  try {
    return {{"mode", "finished"},
            {"name", fs::canonical(folder).filename().string()},
            {"report", nlohmann::json::parse(read_bytes(folder / "report.json"))},
            {"trajectory", trajectory}};
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error((folder / "report.json").string() + ": is damaged: " + plain(error.what()));
  }
}

/// A run whose mesh could not be written does not show an earlier one's.
bool has_mesh(const fs::path& folder, const nlohmann::json& data) {
  return data["report"].contains("mesh") && fs::exists(folder / "mesh.glb");
}

std::string base64(const std::string& bytes) {
  using namespace boost::archive::iterators;
  using Letters = base64_from_binary<transform_width<std::string::const_iterator, 6, 8>>;
  std::string text(Letters(bytes.begin()), Letters(bytes.end()));
  text.append((3 - bytes.size() % 3) % 3, '=');
  return text;
}

}  // namespace

std::string_view viewer_page() {
  return {cairn_viewer_page, static_cast<std::size_t>(cairn_viewer_page_end - cairn_viewer_page)};
}

std::string finished_data(const fs::path& folder) {
  nlohmann::json data = data_of(folder);
  if (has_mesh(folder, data)) data["mesh"] = "mesh.glb";
  return text_of(data);
}

void write_report_page(const fs::path& folder) {
  nlohmann::json data = data_of(folder);
  if (const fs::path mesh = folder / "mesh.glb"; has_mesh(folder, data)) {
    const fs::path preview = folder / "preview.glb";
    const bool fits = fs::file_size(mesh) <= kMaxInlineMesh;
    if (fits || fs::exists(preview))
      data["mesh_base64"] = base64(read_bytes(fits ? mesh : preview));
    else
      data["mesh_left_out"] = mesh.string();
  }
  std::string text = text_of(data);
  for (std::size_t at = 0; (at = text.find('<', at)) != text.npos;) text.replace(at, 1, "\\u003c");  // ends no script
  std::string page(viewer_page());
  page.replace(page.find(kPlace), kPlace.size(), "<script type=\"application/json\" id=\"data\">" + text + "</script>");
  write_whole(folder / "report.html", page);
}

}  // namespace cairn
