// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/outputs.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <numbers>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "base/quoted.hpp"
#include "cairn/mapping/viewer.hpp"
#include "cli/flags.hpp"
#include "cli/json_text.hpp"
#include "cli/old_names.hpp"
#include "cli/output_folder.hpp"
#include "cli/progress.hpp"

namespace cairn::apps {
namespace {

constexpr std::size_t kReportTriangles = 400'000;  // about, in report.html

nlohmann::json to_json(const FoundLoop& loop) {
  const Eigen::Quaterniond q(loop.i_from_j.linear());
  const Eigen::Vector3d& t = loop.i_from_j.translation();
  return {{"from", loop.from},
          {"to", loop.to},
          {"translation", {t.x(), t.y(), t.z()}},
          {"quaternion", {q.x(), q.y(), q.z(), q.w()}},
          {"corners", loop.feature_inliers},
          {"inlier_share", loop.inlier_share},
          {"rmse", loop.rmse},
          {"inlier", loop.inlier}};
}

nlohmann::json to_json(const GravityAlignment& upright) {
  return {{"source", std::string(to_string(upright.source))},
          {"known", upright.known},
          {"turned_degrees", upright.rotation_angle() * 180 / std::numbers::pi},
          {"words", with_flag_names(upright.description)}};
}

nlohmann::json to_json(const InertialReport& inertial) {
  nlohmann::json j{{"state", std::string(to_string(inertial.state))}};
  if (inertial.state != InertialReport::State::trusted) return j;
  constexpr double kDegrees = 180 / std::numbers::pi;
  const Eigen::Quaterniond& q = inertial.imu_from_camera;
  const auto list = [](const Eigen::Vector3d& v) { return nlohmann::json{v.x(), v.y(), v.z()}; };
  j.update({{"gyroscope_bias", list(inertial.gyroscope_bias)},
            {"accelerometer_bias", list(inertial.accelerometer_bias)},
            {"rotation", {q.x(), q.y(), q.z(), q.w()}},
            {"rotation_degrees", kDegrees * Eigen::AngleAxisd(q).angle()},
            {"lever_m", list(inertial.lever)},
            {"clock_s", inertial.clock},
            {"gravity_sigma_degrees", kDegrees * inertial.gravity_sigma}});
  return j;
}

nlohmann::json to_json(const Statistics& statistics) {
  nlohmann::json report{
      {"device", statistics.device},
      {"device_waits", statistics.device_waits},
      {"device_memory_peak_mb", static_cast<double>(statistics.device_memory_peak) / (1 << 20)},
      {"clock_offset", statistics.clock_offset},
      {"focal_length",
       {{"best_scale", statistics.focal.scale},
        {"error_given_pixels", statistics.focal.error_given},
        {"error_best_pixels", statistics.focal.error_best},
        {"pairs", statistics.focal.pairs}}},
      {"bricks",
       {{"allocated", statistics.bricks}, {"paged_out", statistics.paged_out}, {"paged_in", statistics.paged_in}}},
      {"keyframes", statistics.keyframes},
      {"submaps",
       {{"ended", statistics.submaps},
        {"components", statistics.components},
        {"host_memory_peak_mb", static_cast<double>(statistics.submap_memory_peak) / (1 << 20)},
        {"read_back", statistics.submaps_read_back}}},
      {"places",
       {{"looked_up", statistics.database_queries},
        {"tried", statistics.loops_tried},
        {"graph_ms", statistics.graph_ms},
        {"world_ms", statistics.world_ms}}}};
  if (statistics.inertial.state != InertialReport::State::absent) report["inertial"] = to_json(statistics.inertial);
  if (statistics.sigma_median > 0)
    report["surface_sigma"] = {{"median_m", statistics.sigma_median}, {"p95_m", statistics.sigma_95}};
  for (const auto& [kernel, time] : statistics.kernels)
    report["kernels"][kernel] = {{"calls", time.calls},
                                 {"total_ms", time.milliseconds},
                                 {"mean_ms", time.milliseconds / std::max(1, time.calls)}};
  return report;
}

}  // namespace

nlohmann::json to_json(const Verdict& verdict) {
  nlohmann::json j{{"level", to_string(verdict.level)},
                   {"words", verdict.words},
                   {"reasons", verdict.reasons},
                   {"evidence", nlohmann::json::array()}};
  for (const Verdict::Item& item : verdict.evidence)
    j["evidence"].push_back({{"name", item.name},
                             {"value", item.value},
                             {"limit", item.limit},
                             {"unit", item.unit},
                             {"verdict", to_string(item.level)},
                             {"text", item.text}});
  return j;
}

void print_upright(const nlohmann::json& upright) {
  const double turned = upright["turned_degrees"];
  const auto words = upright["words"].get<std::string>();
  fmt::print("upright     {}{}\n", words, turned > 0.05 ? fmt::format("; rotated by {:.1f} degrees", turned) : "");
}

void print_inertial(const nlohmann::json& inertial) {
  const auto state = inertial["state"].get<std::string>();
  if (state != "trusted") {
    fmt::print("inertial    sensors {}: {}\n", state,
               state == "contradicted" ? "not used" : "too little motion to use them");
    return;
  }
  const auto vector = [&](const char* name) {
    const auto v = inertial[name].get<std::array<double, 3>>();
    return Eigen::Vector3d(v[0], v[1], v[2]);
  };
  fmt::print(
      "inertial    sensors trusted: bias {:.2f} degrees/s and {:.3f} m/s^2, mounted {:.1f} degrees and {:.1f} cm from "
      "the camera, clock {:+.1f} ms\n",
      vector("gyroscope_bias").norm() * 180 / std::numbers::pi, vector("accelerometer_bias").norm(),
      inertial["rotation_degrees"].get<double>(), 100 * vector("lever_m").norm(),
      1000 * inertial["clock_s"].get<double>());
}

nlohmann::json to_json(const ExportReport& e) {
  nlohmann::json j{{"full_triangles", e.full_triangles},
                   {"triangles", e.triangles},
                   {"vertices", e.vertices},
                   {"components_removed", e.components_removed},
                   {"holes_filled", e.holes_filled},
                   {"error_m", e.error},
                   {"parts", e.parts},
                   {"ms", e.stage_ms}};
  if (e.points > 0) j["points"] = e.points;
  if (e.tiles > 0) j["tiles"] = e.tiles;
  if (e.textures > 0)
    j.update({{"textures", e.textures},
              {"charts", e.charts},
              {"texel_m", e.texel},
              {"texels", e.texels},
              {"textured_share", e.textured_share},
              {"keyframes", e.keyframes}});
  add_old_fields(j);
  return j;
}

void Outputs::attempt(const char* what, const std::function<void()>& work) {
  try {
    work();
  } catch (const std::exception& error) {
    if (!reason_) reason_ = error.what();
    failed_.emplace_back(what);
  }
}

void Outputs::write_session(Mapper& mapper, Session& session, const std::string& note) {
  timed_("write session", [&] {
    session.checkpoint(mapper, note);
    if (const auto problem = session.problem()) throw std::runtime_error(*problem);
  });
}

/// Writes the last recording's trajectory, and the earlier recordings' beside it.
void Outputs::write_trajectories(const Mapper& mapper) {
  for (int i = 0; i < mapper.recordings(); ++i)
    if (const Trajectory t = mapper.trajectory(i); !t.empty())
      write_trajectory(output_ / name_of_trajectory(i, mapper.recordings()), t);
}

/// Falls back to a mesh without texture if the texture fails and was not requested.
ExportReport Outputs::write_model(Mapper& mapper, MeshArguments& options, const ExportProgress& progress) {
  const std::filesystem::path file = output_ / "mesh.glb";
  if (options.texture_requested || options.no_texture) return export_mesh(mapper.map(), file, options, progress);
  try {
    return export_mesh(mapper.map(), file, options, progress);
  } catch (const std::exception& error) {
    options.no_texture = true;
    ExportReport untextured = export_mesh(mapper.map(), file, options, progress);
    warnings_.push_back(fmt::format("{}; the mesh has the voxels' colors instead of a texture", error.what()));
    return untextured;
  }
}

/// Also writes a smaller mesh for report.html if mesh.glb is too large.
std::optional<ExportReport> Outputs::write_mesh(Mapper& mapper, const MeshArguments& options) {
  std::optional<ExportReport> mesh;
  timed_("mesh", [&] {
    Progress progress(std::nullopt, "");
    MeshArguments both = options;
    both.preview = {.file = output_ / "preview.glb", .triangles = kReportTriangles};
    std::filesystem::remove(both.preview.file);
    mesh = write_model(mapper, both, export_progress(progress));
    if (std::filesystem::file_size(output_ / "mesh.glb") <= kMaxInlineMesh) std::filesystem::remove(both.preview.file);
  });
  return mesh;
}

nlohmann::json Outputs::write(Mapper& mapper, Session* session, const MeshArguments& options, const std::string& note) {
  mapper.freeze_gravity();  // one gravity direction for all files and for the session
  // The most expensive results are saved first.
  if (session != nullptr) attempt("session", [&] { write_session(mapper, *session, note); });
  attempt("trajectory.txt", [&] { write_trajectories(mapper); });
  if (session != nullptr)
    attempt("graph.g2o", [&] {
      mapper.map().write_graph(output_ / "graph.g2o");
      mapper.map().write_graph(output_ / "graph.svg");
    });
  attempt(kMapCamera, [&] { write_rig(output_ / kMapCamera, mapper.rig()); });
  std::optional<ExportReport> mesh;
  if (has_mesh_) {
    attempt("map.vdb", [&] { timed_("write map", [&] { mapper.map().write_grids(output_ / "map.vdb"); }); });
    attempt("mesh.glb", [&] { mesh = write_mesh(mapper, options); });
  }

  nlohmann::json report = to_json(mapper.statistics());
  const GravityAlignment upright = mapper.upright();
  report["upright"] = to_json(upright);
  report["camera"] = kMapCamera;
  if (upright.off) report["tilt_degrees"] = *upright.off * 180 / std::numbers::pi;
  report["searched"] = nlohmann::json::array();
  for (const KeyframeInfo& keyframe : mapper.keyframes())
    report["searched"].push_back(nlohmann::json::array({keyframe.timestamp, keyframe.searched}));
  report["loops"] = nlohmann::json::array();
  if (mesh) report["mesh"] = to_json(*mesh);
  for (const FoundLoop& loop : mapper.loops()) report["loops"].push_back(to_json(loop));
  return report;
}

void Outputs::write_report(const nlohmann::json& report) {
  attempt("report.html", [&] {
    write_whole(output_ / "report.json", format_json(report, 1) + '\n');
    if (has_mesh_) write_report_page(output_);
  });
}

void Outputs::remove_old(const Mapper& mapper, bool has_graph) const {
  if (!has_mesh_)
    for (const char* name : {"mesh.glb", "preview.glb", "map.vdb", "report.html"})
      std::filesystem::remove(output_ / name);
  if (!has_graph)
    for (const char* name : {"graph.g2o", "graph.svg"}) std::filesystem::remove(output_ / name);
  for (const char* name : {"splats.spz", "splats.ply"}) std::filesystem::remove(output_ / name);
  for (int i = mapper.recordings() - 1; std::filesystem::remove(output_ / name_of_trajectory(i)); ++i) continue;
}

void Outputs::expect_all() const {
  if (!reason_) return;
  const bool has_session =
      (failed_.empty() || failed_[0] != "session") && std::filesystem::exists(output_ / "session" / "state.cbor");
  if (failed_.empty())
    throw std::runtime_error(fmt::format("{}; {} contains the frames fused before{}", *reason_, output_.string(),
                                         has_session ? "; the same command with --resume continues from there" : ""));
  std::string what = fmt::format("{}", fmt::join(failed_, ", "));
  std::string remedy = has_session ? "the same command with --resume writes the missing files"
                                   : "run the same command again from the beginning";
  if (failed_ == std::vector<std::string>{"mesh.glb"})
    remedy = fmt::format("write it again with cairn export {} -o {}", quoted(output_), quoted(output_ / "mesh.glb"));
  throw std::runtime_error(fmt::format("{}; not written: {}; all other files in {} are written: {}", *reason_, what,
                                       output_.string(), remedy));
}

}  // namespace cairn::apps
