// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/map_info.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "cairn/eval/verdict.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/session.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "cli/json_text.hpp"
#include "cli/old_names.hpp"
#include "cli/outputs.hpp"
#include "cli/run.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Only the report is damaged; the map's other files are intact.
constexpr const char* kUnreadable =
    ": is not valid JSON, so it was truncated or changed; the rest of the map can be used with cairn export, and its "
    "mesh.glb with cairn view";
constexpr std::uintmax_t kMaxMeshSize = std::uintmax_t{256}
                                        << 20;  // bytes; larger meshes are not read for their extent

constexpr std::array kFiles{
    std::pair{"mesh.glb", "the surface, for Blender and viewers"},
    std::pair{"preview.glb", "the surface with fewer triangles, for pages"},
    std::pair{"map.vdb", "the voxels, as OpenVDB grids"},
    std::pair{"trajectory.txt", "the camera's poses"},
    std::pair{"graph.g2o", "keyframes and loops"},
    std::pair{"graph.svg", "keyframes and loops as a picture"},
    std::pair{"report.html", "a page with all results, for a browser"},
    std::pair{"report.json", "all results, for programs"},
    std::pair{"session", "data to resume the run (--resume)"},
};

std::uintmax_t size_of(const fs::path& path) {
  if (!fs::is_directory(path)) return fs::file_size(path);
  std::uintmax_t size = 0;
  for (const auto& entry : fs::recursive_directory_iterator(path))
    if (entry.is_regular_file()) size += entry.file_size();
  return size;
}

std::string format_bytes(std::uintmax_t bytes) {
  if (bytes < 1'000'000) return fmt::format("{:.1f} kB", static_cast<double>(bytes) / 1e3);
  return fmt::format("{:.1f} MB", static_cast<double>(bytes) / 1e6);
}

nlohmann::json report_of(const fs::path& folder) {
  nlohmann::json report;
  try {
    report = read_json(folder / "report.json");
  } catch (const std::exception&) {
    throw std::runtime_error((folder / "report.json").string() + kUnreadable);
  }
  if (!report.is_object() || !report.contains("frames"))
    throw std::runtime_error(
        (folder / "report.json").string() +
        ": is not a report of a run; the map may still be complete: cairn view shows its mesh.glb");
  return report;
}

Verdict::Level level_of(const std::string& name) {
  for (const auto level : {Verdict::Level::weak, Verdict::Level::bad})
    if (name == to_string(level)) return level;
  return Verdict::Level::good;
}

/// Verdict of the report. Older reports without a verdict are judged by their frame counts.
Verdict verdict_of(const nlohmann::json& report) {
  if (report.contains("verdict")) {
    const auto& json = report["verdict"];
    Verdict v{.words = json.at("words"), .reasons = json.at("reasons")};
    v.level = level_of(json.at("level"));
    for (const auto& item : json.value("evidence", nlohmann::json::array()))
      v.evidence.push_back({.name = item.at("name"),
                            .value = item.at("value"),
                            .limit = item.at("limit"),
                            .unit = item.at("unit"),
                            .level = level_of(item.at("verdict")),
                            .text = item.at("text")});
    return v;
  }
  const auto& frames = report.at("frames");
  return RunMonitor(Rig{}, Options{})
      .verdict({.total = frames.at("total"),
                .fused = frames.at("fused"),
                .components = report.value(nlohmann::json::json_pointer("/submaps/components"), 1),
                .warnings = report.value("warnings", std::vector<std::string>{})});
}

double length_of(const Trajectory& path) {
  double length = 0;
  for (std::size_t i = 1; i < path.size(); ++i)
    length += (path[i].world_from_camera.translation() - path[i - 1].world_from_camera.translation()).norm();
  return length;
}

/// Width, height and depth of the surface along the world axes, in meters.
std::optional<Eigen::Vector3f> extent_of(const fs::path& mesh) {
  if (!fs::exists(mesh) || fs::file_size(mesh) > kMaxMeshSize) return std::nullopt;
  Eigen::AlignedBox3f box;
  for (const Mesh& part : read_mesh_parts(mesh))
    for (const auto& p : part.positions) box.extend(p);
  return box.isEmpty() ? std::nullopt : std::optional<Eigen::Vector3f>(box.sizes());
}

Json files_in(const fs::path& folder) {
  Json files = Json::array();
  for (const auto& [name, what] : kFiles)
    if (fs::exists(folder / name)) files.push_back({{"name", name}, {"bytes", size_of(folder / name)}, {"what", what}});
  return files;
}

Json summary_of(const fs::path& folder) {
  if (!fs::exists(folder / "report.json")) {
    const auto progressed = RunProgress::from(Session::info(folder / "session").note);
    return {{"cut_off", true},
            {"frames", {{"total", progressed.frames.size()}, {"fused", progressed.frames.count("fused")}}},
            {"files", files_in(folder)}};
  }
  const nlohmann::json report = report_of(folder);
  Json json{{"verdict", to_json(verdict_of(report))},
            {"sequence", report.value("sequence", "")},
            {"frames", report.at("frames")},
            {"keyframes", report.value("keyframes", 0)},
            {"loops", report.contains("loops") ? report["loops"].size() : 0},
            {"voxel_size", report.value(nlohmann::json::json_pointer("/options/voxel_size"), 0.0)}};
  if (report.contains("interrupted")) json["interrupted"] = report["interrupted"];
  if (report.contains("surface_sigma")) json["surface_sigma"] = report["surface_sigma"];
  if (report.contains("mesh")) {
    const auto& mesh = report["mesh"];
    json["triangles"] = mesh.value("triangles", 0);
    if (mesh.contains("textures")) json["texel_m"] = mesh.value("texel_m", 0.0);
  }
  if (const auto extent = extent_of(folder / "mesh.glb")) json["extent_m"] = {extent->x(), extent->y(), extent->z()};
  if (fs::exists(folder / "trajectory.txt")) {
    const Trajectory path = read_trajectory(folder / "trajectory.txt");
    json["path"] = {{"meters", length_of(path)},
                    {"seconds", path.empty() ? 0.0 : path.back().timestamp - path.front().timestamp}};
  }
  json["files"] = files_in(folder);
  add_old_fields(json);
  return json;
}

void print(const Json& json) {
  const auto line = [](const char* name, const std::string& text) { fmt::print("{:<16}{}\n", name, text); };
  if (json.contains("cut_off"))
    line("incomplete",
         fmt::format("after {} frames: repeat its command with --resume", json["frames"]["total"].get<int>()));
  if (json.contains("sequence")) line("made from", json["sequence"]);
  if (json.contains("path"))
    line("path", fmt::format("{:.1f} m in {:.1f} s", json["path"]["meters"].get<double>(),
                             json["path"]["seconds"].get<double>()));
  if (json.contains("extent_m"))
    line("extent", fmt::format("{:.1f} x {:.1f} x {:.1f} m", json["extent_m"][0].get<double>(),
                               json["extent_m"][1].get<double>(), json["extent_m"][2].get<double>()));
  if (json.contains("voxel_size") && json["voxel_size"] > 0)
    line("voxels", fmt::format("{:.1f} cm", 100 * json["voxel_size"].get<double>()));
  if (json.contains("triangles"))
    line("surface", fmt::format("{} triangles, {}", json["triangles"].get<std::size_t>(),
                                json.contains("texel_m")
                                    ? fmt::format("textured, {:.1f} mm a texel", 1000 * json["texel_m"].get<double>())
                                    : "with the voxels' colors"));
  if (json.contains("surface_sigma"))
    line("uncertainty", fmt::format("{:.2f} mm, 95 % of the surface below {:.2f} mm",
                                    1000 * json["surface_sigma"]["median_m"].get<double>(),
                                    1000 * json["surface_sigma"]["p95_m"].get<double>()));
  if (json.contains("keyframes"))
    line("keyframes", fmt::format("{}, {} loops", json["keyframes"].get<int>(), json["loops"].get<int>()));
  for (const Json& file : json["files"])
    line(file["name"].get<std::string>().c_str(),
         fmt::format("{:>10}  {}", format_bytes(file["bytes"]), file["what"].get<std::string>()));
  if (json.contains("verdict")) {
    const nlohmann::json plain_json = parsed_json(json.dump());
    apps::print(verdict_of(plain_json), stdout);
  }
  if (!json.contains("interrupted")) return;
  const auto& interrupted = json["interrupted"];
  if (interrupted.contains("stage"))
    fmt::print("interrupted in the stage {}: {}\n", interrupted["stage"].get<std::string>(),
               interrupted["remedy"].get<std::string>());
  else
    fmt::print("{} frames remain: {}\n", interrupted["frames_left"].get<int>(),
               interrupted["remedy"].get<std::string>());
}

}  // namespace

bool is_map_folder(const fs::path& folder) {
  return fs::exists(folder / "session" / "state.cbor") ||
         (fs::exists(folder / "report.json") && fs::exists(folder / "trajectory.txt"));
}

void print_map_info(const fs::path& folder, bool as_json) {
  try {
    const Json json = summary_of(folder);
    if (as_json)
      fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace));
    else
      print(json);
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(
        fmt::format("{}: is damaged: {}", (folder / "report.json").string(), strip_json_prefix(error.what())));
  }
}

}  // namespace cairn::apps
