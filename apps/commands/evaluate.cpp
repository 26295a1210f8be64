// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <tuple>

#include "base/path_kind.hpp"
#include "cairn/building/project.hpp"
#include "cairn/eval/evaluation.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/map.hpp"
#include "cairn/mapping/splat_training.hpp"
#include "cairn/synthetic/scene.hpp"
#include "cli/commands.hpp"
#include "cli/json_text.hpp"
#include "cli/open_with_cameras.hpp"
#include "cli/output_folder.hpp"
#include "cli/quantity.hpp"
#include "cli/sources.hpp"
#include "cli/view_error.hpp"
#include "options/option_ranges.hpp"

namespace cairn::apps {
namespace {

constexpr double kMaxInterval = 86400, kMaxCoordinate = 1e6, kMaxCount = 1e9;  // seconds, meters, count

struct Arguments {
  std::string estimate, truth, seen, trajectory, truth_trajectory, poses, height;
  std::vector<double> box;
  double rpe_interval = 1.0, max_time_difference = 0.02;
  float esdf_voxel_size = 0;
  int frames = 0, samples = 200000, step = 10;
  std::optional<int> map_step;
  bool json = false, seams = false;
};

nlohmann::json to_json(const ErrorStatistics& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"p95", s.p95}, {"max", s.max}, {"count", s.count}};
}

void print_row(const std::string& name, const ErrorStatistics& s, double scale, const char* unit) {
  fmt::print("{:<22}{:>10.3f}{:>10.3f}{:>10.3f}{:>10.3f}{:>10.3f}  {}\n", name, scale * s.rmse, scale * s.mean,
             scale * s.median, scale * s.p95, scale * s.max, unit);
}
void print_head() { fmt::print("{:<22}{:>10}{:>10}{:>10}{:>10}{:>10}\n", "", "rmse", "mean", "median", "95 %", "max"); }

/// Angle in radians between the estimate's gravity, +y, and the nearest axis of the true world; none if they differ by
/// more than 20 degrees, as for a true world that is not upright.
std::optional<double> gravity_error(const TrajectoryError& e) {
  constexpr double kMaxError = 20 * std::numbers::pi / 180;
  const double error = std::acos(std::min(1.0, e.truth_from_estimate.linear().col(1).cwiseAbs().maxCoeff()));
  return error < kMaxError ? std::optional(error) : std::nullopt;
}

void evaluate_trajectory_files(const Arguments& a) {
  const auto e =
      evaluate_trajectory(read_trajectory(a.estimate), recorded_truth(a.truth), a.rpe_interval, a.max_time_difference);
  if (a.json) {
    nlohmann::json j{{"ate_m", to_json(e.ate)},
                     {"rpe_translation_m", to_json(e.rpe_translation)},
                     {"rpe_rotation_rad", to_json(e.rpe_rotation)},
                     {"rpe_interval_s", e.rpe_interval},
                     {"estimated_poses", e.estimated_poses},
                     {"matched_poses", e.matched_poses}};
    if (a.frames > 0) j["frames"] = a.frames;
    if (const auto error = gravity_error(e)) j["gravity_rad"] = *error;
    fmt::print("{}\n", format_json(j, 2));
    return;
  }
  print_head();
  print_row("ATE", e.ate, 100, "cm");
  print_row(fmt::format("RPE over {} s", e.rpe_interval), e.rpe_translation, 100, "cm");
  print_row("", e.rpe_rotation, 180 / std::numbers::pi, "degrees");
  if (const auto error = gravity_error(e))
    fmt::print("gravity               {:.2f} degrees from the nearest axis of the true world\n",
               *error * 180 / std::numbers::pi);
  fmt::print(
      "poses                 {}{}, {} with a true pose\n", e.estimated_poses,
      a.frames > 0 ? fmt::format(" for {} frames ({:.1f} %)", a.frames, 100.0 * e.estimated_poses / a.frames) : "",
      e.matched_poses);
}

/// Angle in radians between +y of both worlds, by the orientations of the camera.
std::optional<double> gravity_error_of(const Trajectory& estimate, const Trajectory& truth) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const StampedPose& pose : estimate)
    if (const auto at = pose_at(truth, pose.timestamp))
      sum += (at->linear() * pose.world_from_camera.linear().transpose()).col(1);
  return sum.norm() > 0 ? std::optional(std::acos(std::min(1.0, sum.normalized().y()))) : std::nullopt;
}

/// Errors of the estimated inertial sensors: lengths of the differences, in the units of report.json.
void evaluate_inertial_sensors(const Arguments& a) {
  const std::filesystem::path folder(a.estimate), truth_file = std::filesystem::path(a.truth) / "groundtruth_imu.json";
  if (!std::filesystem::exists(truth_file))
    throw std::runtime_error(a.truth + ": has no groundtruth_imu.json; give a recording of `cairn synth --imu`");
  const auto truth = read_json(truth_file), report = read_json(folder / "report.json");
  if (!report.contains("inertial") || !report["inertial"].contains("clock_s"))
    throw std::runtime_error(a.estimate + ": has no trusted inertial sensors");
  const nlohmann::json& estimate = report["inertial"];
  const auto off = [&](const char* name) {
    const auto e = estimate.at(name).get<std::array<double, 3>>(), t = truth.at(name).get<std::array<double, 3>>();
    return std::hypot(e[0] - t[0], e[1] - t[1], e[2] - t[2]);
  };
  const auto rotation = [](const nlohmann::json& j) {
    const auto q = j.at("rotation").get<std::array<double, 4>>();
    return Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized();
  };
  nlohmann::json j{{"gyroscope_bias", off("gyroscope_bias")},
                   {"accelerometer_bias", off("accelerometer_bias")},
                   {"rotation_rad", rotation(estimate).angularDistance(rotation(truth))},
                   {"lever_m", off("lever_m")},
                   {"clock_s", estimate.at("clock_s").get<double>() - truth.at("clock_s").get<double>()}};
  if (const auto error = gravity_error_of(read_trajectory(folder / "trajectory.txt"), recorded_truth(a.truth)))
    j["gravity_rad"] = *error;
  if (a.json) {
    fmt::print("{}\n", format_json(j, 2));
    return;
  }
  constexpr double kDegrees = 180 / std::numbers::pi;
  fmt::print("bias      {:.4f} degrees/s of the gyroscope, {:.4f} m/s^2 of the accelerometer\n",
             kDegrees * j["gyroscope_bias"].get<double>(), j["accelerometer_bias"].get<double>());
  fmt::print("mounting  {:.2f} degrees, {:.2f} cm\n", kDegrees * j["rotation_rad"].get<double>(),
             100 * j["lever_m"].get<double>());
  fmt::print("clock     {:+.2f} ms\n", 1000 * j["clock_s"].get<double>());
  if (j.contains("gravity_rad")) fmt::print("gravity   {:.2f} degrees\n", kDegrees * j["gravity_rad"].get<double>());
}

/// All recordings of a project in one frame. Timestamps are shifted per recording, since recordings may start at the
/// same time.
struct ProjectTrajectories {
  Trajectory estimate, truth;
  std::vector<std::pair<std::string, std::pair<std::size_t, std::size_t>>> recordings;  // index ranges into `estimate`
  std::vector<std::string> without_truth;
};

ProjectTrajectories read_all(const std::filesystem::path& folder) {
  constexpr double kTimeShift = 1e7;  // seconds
  const Project plan = read_plan(folder);
  ProjectTrajectories all;
  for (std::size_t r = 0; r < plan.recordings.size(); ++r) {
    const std::string& name = plan.recordings[r].name;
    const auto file = folder / name_of_trajectory(static_cast<int>(r), static_cast<int>(plan.recordings.size()));
    const Trajectory estimate = std::filesystem::exists(file) ? read_trajectory(file) : Trajectory{};
    const Trajectory truth = recorded_truth(name);
    if (truth.empty()) all.without_truth.push_back(name);
    if (truth.empty() || estimate.empty()) continue;
    const double time_shift = kTimeShift * static_cast<double>(r) - truth.front().timestamp;
    const std::size_t begin = all.estimate.size();
    for (StampedPose pose : estimate) pose.timestamp += time_shift, all.estimate.push_back(pose);
    for (StampedPose pose : truth) pose.timestamp += time_shift, all.truth.push_back(pose);
    all.recordings.push_back({name, {begin, all.estimate.size()}});
  }
  return all;
}

/// Distances in meters between the surfaces of two parts at the same place, in both directions, over all cells.
struct Seams {
  double sum = 0, worst = 0;  // sum over all samples; largest mean of two parts in a cell
  int samples = 0;
};

Seams seams_of(const std::filesystem::path& folder) {
  Seams seams;
  for (const auto& cell : cells_of(folder)) {
    const auto surfaces = segment_surfaces(folder, cell);
    for (const SegmentSurface& a : surfaces)
      for (const SegmentSurface& b : surfaces) {
        if (&a == &b) continue;
        const ErrorStatistics seam = evaluate_seam(a.mesh, b.mesh);
        if (seam.count < 100) continue;  // the parts barely overlap
        seams.sum += seam.mean * seam.count, seams.samples += seam.count;
        seams.worst = std::max(seams.worst, seam.mean);
      }
  }
  return seams;
}

void evaluate_plan(const Arguments& a) {
  const ProjectTrajectories all = read_all(a.estimate);
  nlohmann::json json{{"recordings", nlohmann::json::array()}};
  if (!a.json) print_head();
  if (!all.recordings.empty()) {
    const TrajectoryError e = evaluate_trajectory(all.estimate, all.truth);
    json["ate_m"] = to_json(e.ate);
    if (!a.json) print_row("ATE over all", e.ate, 100, "cm");
    for (const auto& [name, range] : all.recordings) {
      // Residuals after the joint alignment, not per recording.
      double squared = 0, max_error = 0;
      int count = 0;
      for (std::size_t i = range.first; i < range.second; ++i) {
        const auto truth = pose_at(all.truth, all.estimate[i].timestamp);
        if (!truth) continue;
        const double off =
            (e.truth_from_estimate * all.estimate[i].world_from_camera.translation() - truth->translation()).norm();
        squared += off * off, max_error = std::max(max_error, off), ++count;
      }
      const double rmse = std::sqrt(squared / std::max(1, count));
      json["recordings"].push_back({{"name", name}, {"rmse_m", rmse}, {"max_m", max_error}, {"poses", count}});
      if (!a.json) fmt::print("{}: {:.2f} cm, {:.2f} at most, of {} poses\n", name, 100 * rmse, 100 * max_error, count);
    }
  }
  for (const std::string& name : all.without_truth) fmt::print(stderr, "warning: {}: has no true poses\n", name);
  const Seams seams = a.seams ? seams_of(a.estimate) : Seams{};
  if (seams.samples > 0) {
    const double mean = seams.sum / seams.samples;
    json["seams_m"] = {{"mean", mean}, {"worst_pair", seams.worst}};
    if (!a.json)
      fmt::print(
          "seams                 {:.2f} mm mean distance between the surfaces of two segments, at most {:.2f} in a "
          "cell\n",
          1000 * mean, 1000 * seams.worst);
  }
  if (a.json) fmt::print("{}\n", format_json(json, 2));
}

/// Keeps the triangles with their center in the box (x y z of two opposite corners); an empty box keeps all.
Mesh crop(Mesh mesh, const std::vector<double>& box) {
  if (box.empty()) return mesh;
  Eigen::AlignedBox3f inside;
  for (const std::size_t i : {0u, 3u}) inside.extend(Eigen::Vector3d(box[i], box[i + 1], box[i + 2]).cast<float>());
  std::erase_if(mesh.triangles, [&](const auto& t) {
    return !inside.contains((mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3.0f);
  });
  return mesh;
}

void evaluate_mesh_files(const Arguments& a) {
  Mesh estimate = read_mesh(a.estimate);
  if (!a.trajectory.empty()) {
    const auto by = evaluate_trajectory(read_trajectory(a.trajectory), recorded_truth(a.truth_trajectory));
    const Eigen::Isometry3f truth_from_estimate = by.truth_from_estimate.cast<float>();
    for (auto& p : estimate.positions) p = truth_from_estimate * p;
    for (auto& n : estimate.normals) n = truth_from_estimate.linear() * n;
  }
  const Mesh seen = a.seen.empty() ? Mesh{} : crop(read_mesh(a.seen), a.box);
  const auto e =
      evaluate_mesh(crop(std::move(estimate), a.box), read_mesh(a.truth), a.samples, a.seen.empty() ? nullptr : &seen);
  if (a.json) {
    nlohmann::json j{{"accuracy_m", to_json(e.accuracy)}, {"completeness_m", to_json(e.completeness)}};
    for (const auto& at : e.at)
      j["at"].push_back(
          {{"threshold_m", at.threshold}, {"precision", at.precision}, {"recall", at.recall}, {"f_score", at.f_score}});
    fmt::print("{}\n", format_json(j, 2));
    return;
  }
  print_head();
  print_row("accuracy", e.accuracy, 1000, "mm");
  print_row("completeness", e.completeness, 1000, "mm");
  for (const auto& at : e.at)
    fmt::print("within {:.0f} cm           {:.2f} % of the estimate, {:.2f} % of the truth, F-score {:.2f} %\n",
               100 * at.threshold, 100 * at.precision, 100 * at.recall, 100 * at.f_score);
}

void evaluate_topology_file(const Arguments& a) {
  const MeshTopology t = examine_topology(read_mesh(a.estimate));
  if (a.json) {
    const nlohmann::json j{{"non_manifold_edges", t.non_manifold_edges},
                           {"non_manifold_vertices", t.non_manifold_vertices},
                           {"coincident_triangles", t.coincident_triangles},
                           {"degenerate_triangles", t.degenerate_triangles},
                           {"unreferenced_vertices", t.unreferenced_vertices},
                           {"components", t.components},
                           {"borders", t.borders},
                           {"border_edges", t.border_edges},
                           {"border_length_m", t.border_length}};
    fmt::print("{}\n", format_json(j, 2));
    return;
  }
  fmt::print("non-manifold edges     {}\nnon-manifold vertices  {}\ncoincident triangles   {}\n", t.non_manifold_edges,
             t.non_manifold_vertices, t.coincident_triangles);
  fmt::print("degenerate triangles   {}\nunreferenced vertices  {}\n", t.degenerate_triangles, t.unreferenced_vertices);
  fmt::print("components             {}\nborders                {}, {:.1f} m long\n", t.components, t.borders,
             t.border_length);
}

void evaluate_view_images(const Arguments& a) {
  Eigen::Isometry3d world_from_recording = Eigen::Isometry3d::Identity();
  if (!a.trajectory.empty())
    world_from_recording = estimate_from_truth(read_trajectory(a.trajectory), recorded_truth(a.truth_trajectory));
  const auto recording = with_poses(open_source(a.truth), recorded_truth(a.poses.empty() ? a.truth : a.poses));
  const ViewError e = has_splats(a.estimate)
                          ? evaluate_views(read_splats(a.estimate), *recording, world_from_recording, a.step)
                          : evaluate_views(read_mesh_parts(a.estimate), *recording, world_from_recording, a.step);
  if (a.json)
    fmt::print("{}\n", format_json(view_error_json(e), 2));
  else
    fmt::print(
        "PSNR     {:.2f} dB over {} frames, {:.2f} dB after a gain per image\ncovered  {:.1f} % of their pixels\n"
        "depth    {:.1f} mm RMS from the measured depth, where within 10 cm\n",
        e.psnr, e.frames, e.psnr_with_gain, 100 * e.covered, 1000 * e.depth_rmse);
}

/// Keyframes, inlier loop closures and held-out frames of a report.
struct Report {
  std::vector<MeasuredLoop> loops;
  std::vector<KeyframeInfo> keyframes;
  HoldOut hold_out;
  double clock_offset = 0;  // seconds: trajectory.txt minus frame times
  std::string camera;       // camera file, for corrected depth
};

Report read_report(const std::filesystem::path& file) {
  Report reported;
  try {
    const auto report = read_json(file);
    for (const auto& l : report.at("loops")) {
      if (!l.at("inlier").get<bool>()) continue;
      const auto t = l.at("translation").get<std::array<double, 3>>();
      const auto q = l.at("quaternion").get<std::array<double, 4>>();
      MeasuredLoop& loop = reported.loops.emplace_back(MeasuredLoop{.from = l.at("from"), .to = l.at("to")});
      loop.i_from_j.linear() = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).toRotationMatrix();
      loop.i_from_j.translation() = Eigen::Vector3d(t[0], t[1], t[2]);
    }
    for (const auto& [timestamp, searched] : report.at("searched").get<std::vector<std::pair<double, int>>>())
      reported.keyframes.push_back({timestamp, searched});
    if (report.contains("hold_out")) reported.hold_out = hold_out_from(report["hold_out"]);
    reported.clock_offset = report.value("clock_offset", 0.0);
    // Version 0.1 gave the map's camera file the same name as a recording's.
    const bool is_old = !report.contains("camera");
    if (is_old || !report["camera"].is_null()) reported.camera = is_old ? "camera.yaml" : kMapCamera;
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() +
                             ": is not a report.json of `cairn reconstruct`: " + strip_json_prefix(error.what()));
  }
  return reported;
}

void evaluate_loops_file(const Arguments& a) {
  const Report reported = read_report(a.estimate);
  const LoopError e = evaluate_loops(reported.loops, reported.keyframes, recorded_truth(a.truth));
  if (a.json) {
    const nlohmann::json j{{"loops", e.loops}, {"right", e.right}, {"revisits", e.revisits}, {"found", e.found}};
    fmt::print("{}\n", format_json(j, 2));
    return;
  }
  const auto percent = [](int part, int all) { return all == 0 ? 0.0 : 100.0 * part / all; };
  fmt::print("precision  {} of {} loops are correct ({:.0f} %)\n", e.right, e.loops, percent(e.right, e.loops));
  fmt::print("recall     {} of {} keyframes in a revisited place have a loop ({:.0f} %)\n", e.found, e.revisits,
             percent(e.found, e.revisits));
}

nlohmann::json to_json(const MapError& e, const LoopDrift& drift, bool is_held_out) {
  nlohmann::json j{{"frames", e.frames}, {"held_out", is_held_out}, {"doubled", e.doubled}};
  if (e.psnr > 0) j.update({{"psnr_db", e.psnr}, {"psnr_with_gain_db", e.psnr_with_gain}});
  for (const auto& r : e.ranges)
    j["depth"].push_back({{"from_m", r.from},
                          {"to_m", r.to},
                          {"error_m", to_json(r.depth)},
                          {"elsewhere", r.elsewhere},
                          {"covered", r.covered}});
  if (drift.shift.count > 0) j["loops"] = {{"shift_m", to_json(drift.shift)}, {"turn_rad", to_json(drift.turn)}};
  return j;
}

void evaluate_map_folder(const Arguments& a) {
  const std::filesystem::path folder(a.estimate);
  for (const char* name : {"mesh.glb", "trajectory.txt", "report.json"})
    if (!std::filesystem::exists(folder / name))
      throw std::runtime_error(fmt::format("{}: {}, and has no {}; give a folder written by `cairn reconstruct`",
                                           a.estimate, kind_of_path(folder).words, name));
  const auto [loops, keyframes, held_out, clock_offset, camera] = read_report(folder / "report.json");
  Trajectory poses = read_trajectory(folder / "trajectory.txt");
  for (StampedPose& pose : poses) pose.timestamp -= clock_offset;
  std::vector<double> times;
  times.reserve(keyframes.size());
  for (const KeyframeInfo& keyframe : keyframes) times.push_back(keyframe.timestamp);
  const bool is_held_out = held_out.every > 0;
  const auto recording =
      hold_out(camera.empty() ? open_source(a.truth) : open_with_cameras(a.truth, folder / camera), held_out);
  const MapError e = evaluate_map(read_mesh_parts(folder / "mesh.glb"), *recording, poses, times,
                                  a.map_step.value_or(is_held_out ? 1 : 10), is_held_out, clock_offset);
  const LoopDrift drift = evaluate_loop_drift(loops, poses);
  if (a.json) {
    fmt::print("{}\n", format_json(to_json(e, drift, is_held_out), 2));
    return;
  }
  print_head();
  for (const auto& r : e.ranges) print_row(fmt::format("depth {:.1f} to {:.1f} m", r.from, r.to), r.depth, 1000, "mm");
  for (const auto& r : e.ranges)
    fmt::print(
        "{:.1f} to {:.1f} m          {:.1f} % of the measurements have surface in view, {:.1f} % are elsewhere\n",
        r.from, r.to, 100 * r.covered, 100 * r.elsewhere);
  if (e.psnr > 0)
    fmt::print("PSNR                  {:.2f} dB, {:.2f} dB after a gain per image\n", e.psnr, e.psnr_with_gain);
  fmt::print("doubled               {:.2f} % of the surface has a second sheet within 5 cm\n", 100 * e.doubled);
  if (drift.shift.count > 0)
    fmt::print("loops                 {}, median error {:.1f} mm and {:.2f} degrees\n", drift.shift.count,
               1000 * drift.shift.median, drift.turn.median * 180 / std::numbers::pi);
  fmt::print("frames                {}, {}\n", e.frames,
             is_held_out ? "all held out from the map" : "without keyframes");
}

void evaluate_distance_field(const Arguments& a) {
  EsdfOptions options;
  options.voxel_size = a.esdf_voxel_size;
  const auto field = Map::open(a.estimate).distances(options);
  const double voxel = field->voxel_size();
  const DistanceError e = evaluate_distances(*field, synthetic_scene(a.truth), read_mesh(a.seen));
  const double signs = e.signs == 0 ? 0.0 : static_cast<double>(e.right_signs) / e.signs;
  const double all_signs = e.all_signs == 0 ? 0.0 : static_cast<double>(e.all_right_signs) / e.all_signs;
  if (a.json) {
    const nlohmann::json j{{"distance_m", to_json(e.distance)},
                           {"within_voxel", e.within_voxel},
                           {"voxel_size_m", voxel},
                           {"gradient_mean_rad", e.gradient_mean},
                           {"gradients", e.gradients},
                           {"right_signs", signs},
                           {"right_signs_of_all", all_signs},
                           {"known", e.known}};
    fmt::print("{}\n", format_json(j, 2));
    return;
  }
  print_head();
  print_row("distance", e.distance, 1000, "mm");
  print_row("", e.distance, 1 / voxel, "voxels");
  fmt::print("within a voxel        {:.2f} %\n", 100 * e.within_voxel);
  fmt::print("gradient              {:.2f} degrees mean at {} points away from the medial axis\n",
             e.gradient_mean * 180 / std::numbers::pi, e.gradients);
  fmt::print("sign                  {:.3f} % correct, {:.3f} % with unobserved surfaces\n", 100 * signs,
             100 * all_signs);
  fmt::print("points                {} of {} known points are nearest to an observed surface\n", e.distance.count,
             e.known);
}

/// Reads the format of write_costmap in pictures.hpp.
Costmap read_costmap(const std::filesystem::path& yaml) {
  Costmap map;
  std::ifstream in(yaml);
  std::string image, line;
  double x = 0, y = 0;
  while (std::getline(in, line)) {
    if (line.starts_with("image: ")) image = line.substr(7);
    (void)std::sscanf(line.c_str(), "resolution: %lf", &map.resolution);
    (void)std::sscanf(line.c_str(), "origin: [%lf, %lf", &x, &y);
  }
  map.origin = {x, y};
  std::ifstream picture(yaml.parent_path() / image, std::ios::binary);
  std::string kind;
  int max_value = 0;
  picture >> kind >> map.columns >> map.rows >> max_value;
  picture.get();
  const std::string cells{std::istreambuf_iterator<char>(picture), {}};
  if (image.empty() || !(map.resolution > 0) || kind != "P5" || map.columns < 1 || map.rows < 1 ||
      cells.size() != static_cast<std::size_t>(map.columns) * static_cast<std::size_t>(map.rows))
    throw std::runtime_error(yaml.string() + ": is not a costmap of `cairn esdf --costmap`");
  for (const char cell : cells)
    map.cells.push_back(cell == 0                                ? Costmap::Cell::occupied
                        : static_cast<std::uint8_t>(cell) == 254 ? Costmap::Cell::free
                                                                 : Costmap::Cell::unknown);
  return map;
}

void evaluate_costmap_file(const Arguments& a) {
  Costmap map = read_costmap(a.estimate);
  std::tie(map.low, map.high) = heights_in(a.height);
  const CostmapError e =
      evaluate_costmap(map, synthetic_scene(a.truth), synthetic_camera(), read_trajectory(a.trajectory));
  const double right = e.judged == 0 ? 0.0 : static_cast<double>(e.right) / e.judged;
  if (a.json) {
    const nlohmann::json j{{"judged", e.judged},
                           {"right", right},
                           {"wrongly_free", e.wrongly_free},
                           {"wrongly_occupied", e.wrongly_occupied},
                           {"wrongly_unknown", e.wrongly_unknown},
                           {"unseen", e.unseen},
                           {"hidden", e.hidden}};
    fmt::print("{}\n", j.dump(2));
    return;
  }
  fmt::print("cells                 {}, {:.2f} % correct\n", e.judged, 100 * right);
  fmt::print("wrong                 {} free, {} occupied, {} unknown\n", e.wrongly_free, e.wrongly_occupied,
             e.wrongly_unknown);
  fmt::print("correctly free        {} that no camera observed\n", e.unseen);
  fmt::print("not evaluated         {} free with an obstacle that no camera observed\n", e.hidden);
}

void add_trajectory(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command = evaluate.add_subcommand("trajectory", "ATE and RPE as defined by the TUM benchmark");
  command->add_option("ESTIMATE", a->estimate, "TUM trajectory file")->required()->check(CLI::ExistingFile);
  command->add_option("TRUTH", a->truth, "TUM trajectory file, or a recording with true poses")
      ->required()
      ->check(is_recording);
  add_number(*command, "--rpe-interval", a->rpe_interval, {.min = 0, .max = kMaxInterval, .is_open = true},
             Unit::seconds, "Time between the two poses of a relative error")
      ->capture_default_str();
  add_number(*command, "--max-time-difference", a->max_time_difference,
             {.min = 0, .max = kMaxInterval, .is_open = true}, Unit::seconds, "Maximum time between matched poses")
      ->capture_default_str();
  add_number(*command, "--frames", a->frames, {1, kMaxCount},
             "Number of frames of the sequence, to print the share with a pose");
  command->add_flag("--json", a->json, "Print JSON, in meters and radians");
  command->callback([a] { evaluate_trajectory_files(*a); });
}

void add_inertial(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command =
      evaluate.add_subcommand("inertial", "Estimated biases, mounting, clock and gravity of inertial sensors");
  command->add_option("MAP", a->estimate, "Folder of `cairn reconstruct`")->required()->check(CLI::ExistingDirectory);
  command->add_option("RECORDING", a->truth, "Recording of `cairn synth --imu`")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_flag("--json", a->json, "Print JSON, in SI units and radians");
  command->callback([a] { evaluate_inertial_sensors(*a); });
}

void add_plan_evaluation(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command = evaluate.add_subcommand("plan", "The map of a project, with all trajectories in one frame");
  command->add_option("PLAN", a->estimate, "Folder of a project after optimize")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_flag("--seams", a->seams,
                    "Also the distance between surfaces of the same place from two segments: takes minutes");
  command->add_flag("--json", a->json, "Print JSON, in meters");
  command->callback([a] { evaluate_plan(*a); });
}

void add_mesh(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command = evaluate.add_subcommand("mesh", "Accuracy, completeness and F-score");
  command->add_option("ESTIMATE", a->estimate, "Mesh (.glb, .gltf, .ply)")->required()->check(CLI::ExistingFile);
  command->add_option("TRUTH", a->truth, "Mesh in the same frame")->required()->check(CLI::ExistingFile);
  command->add_option("--seen", a->seen, "Part of the truth that counts for completeness [all]")
      ->check(CLI::ExistingFile);
  auto* by = command
                 ->add_option("--trajectory", a->trajectory,
                              "Trajectory of the estimate; its alignment with the truth transforms the mesh")
                 ->check(CLI::ExistingFile);
  by->needs(
      command->add_option("--truth-trajectory", a->truth_trajectory, "TUM trajectory file, or a recording's folder")
          ->check(CLI::ExistingPath)
          ->needs(by));
  add_number(*command, "--box", a->box, {-kMaxCoordinate, kMaxCoordinate}, Unit::meters,
             "Only surface in this box in the truth's frame: x y z of two corners")
      ->expected(6);
  add_number(*command, "--samples", a->samples, {1, kMaxCount}, "Points on each surface")->capture_default_str();
  command->add_flag("--json", a->json, "Print JSON, in meters");
  command->callback([a] { evaluate_mesh_files(*a); });
}

void add_topology(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command = evaluate.add_subcommand("topology", "Manifoldness, components and borders of a mesh");
  command->add_option("MESH", a->estimate, "Mesh (.glb, .gltf, .ply)")->required()->check(CLI::ExistingFile);
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { evaluate_topology_file(*a); });
}

void add_views(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command =
      evaluate.add_subcommand("views", "PSNR of rendered views of a mesh or of splats against a recording's images");
  command->add_option("MESH", a->estimate, "Mesh (.glb, .gltf, .ply) or splats (.ply, .spz)")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("RECORDING", a->truth, "Folder of a recording with true poses")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("--poses", a->poses, "TUM trajectory file with the recording's poses [its own]")
      ->check(CLI::ExistingFile);
  auto* of_map =
      command
          ->add_option("--trajectory", a->trajectory,
                       "Trajectory of the map; its alignment with the truth transforms the recording's poses")
          ->check(CLI::ExistingFile);
  of_map->needs(command
                    ->add_option("--truth-trajectory", a->truth_trajectory,
                                 "TUM trajectory file, or the folder of the recording that the map was made from")
                    ->check(CLI::ExistingPath)
                    ->needs(of_map));
  add_number(*command, "--step", a->step, {1, kMaxCount}, "Compare every STEP-th frame")->capture_default_str();
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { evaluate_view_images(*a); });
}

void add_map(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command = evaluate.add_subcommand("map", "A map against its own recording, without a ground truth trajectory");
  command->add_option("MAP", a->estimate, "Folder of `cairn reconstruct`")->required()->check(CLI::ExistingDirectory);
  command->add_option("RECORDING", a->truth, "The recording of the map")->required()->check(is_recording);
  add_number(*command, "--step", a->map_step, {1, kMaxCount},
             "Compare every STEP-th frame that is not a keyframe; with --hold-out, every STEP-th held-out frame [10; 1 "
             "for held-out frames]");
  command->add_flag("--json", a->json, "Print JSON, in meters and radians");
  command->callback([a] { evaluate_map_folder(*a); });
}

void add_loops(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command = evaluate.add_subcommand("loops", "Precision and recall of the loop closures");
  command->add_option("REPORT", a->estimate, "report.json of a reconstruction")->required()->check(CLI::ExistingFile);
  command->add_option("TRUTH", a->truth, "TUM trajectory file, or a recording with true poses")
      ->required()
      ->check(is_recording);
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { evaluate_loops_file(*a); });
}

void add_distances(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command = evaluate.add_subcommand("distances", "A map's distance field against a synthetic scene's exact one");
  command->add_option("MAP", a->estimate, "map.vdb in the scene's frame (reconstruct --poses groundtruth.txt)")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("SCENE", a->truth, "As in `cairn synth`")->required();
  command->add_option("--seen", a->seen, "groundtruth_seen.ply of the recording")->required()->check(CLI::ExistingFile);
  add_number(*command, "--esdf-voxel-size", a->esdf_voxel_size, range_of("esdf.voxel_size"), Unit::meters,
             "Voxel of the distance field: 1, 2, 4 or 8 voxels of the map; 0: two [two]");
  command->add_flag("--json", a->json, "Print JSON, in meters and radians");
  command->callback([a] { evaluate_distance_field(*a); });
}

void add_costmap(CLI::App& evaluate, const std::shared_ptr<Arguments>& a) {
  auto* command = evaluate.add_subcommand("costmap", "A costmap against a synthetic scene cut at the same heights");
  command->add_option("COSTMAP", a->estimate, "X.yaml of `cairn esdf --costmap`, in the scene's frame")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("SCENE", a->truth, "As in `cairn synth`")->required();
  command->add_option("--height", a->height, "LOW:HIGH of the costmap")->required();
  command->add_option("--trajectory", a->trajectory, "Trajectory of the camera; cells it observed must not be unknown")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { evaluate_costmap_file(*a); });
}

}  // namespace

void add_evaluate(CLI::App& program) {
  auto* command = program.add_subcommand("evaluate", "Compare a trajectory or a mesh with the truth");
  command->require_subcommand(1);
  const auto a = std::make_shared<Arguments>();
  add_trajectory(*command, a);
  add_mesh(*command, a);
  add_topology(*command, a);
  add_views(*command, a);
  add_map(*command, a);
  add_loops(*command, a);
  add_inertial(*command, a);
  add_distances(*command, a);
  add_costmap(*command, a);
  add_plan_evaluation(*command, a);
}

}  // namespace cairn::apps
