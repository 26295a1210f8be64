// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "base/atomic_file.hpp"
#include "base/file_name.hpp"
#include "base/quoted.hpp"
#include "cairn/building/project.hpp"
#include "cairn/mapping/map.hpp"
#include "cli/cell_option.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/export_options.hpp"
#include "cli/flags.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/json_text.hpp"
#include "cli/output_folder.hpp"
#include "cli/pictures.hpp"
#include "cli/quantity.hpp"
#include "options/option_ranges.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Arguments {
  fs::path map;
  std::optional<std::array<int, 3>> cell;
  std::vector<fs::path> outputs, costmaps;
  std::optional<Up> up;
  fs::path query;
  std::vector<std::string> slice;  // plane and file
  std::string height;
  EsdfOptions esdf;
  std::optional<float> robot_radius;
  int device = -1;
  bool json = false;
};

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

void write_csv(std::ostream& out, const std::vector<Eigen::Vector3f>& points,
               const std::vector<DistanceField::Answer>& answers) {
  out << "x,y,z,distance,gx,gy,gz,state\n";
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3f& p = points[i];
    const DistanceField::Answer& a = answers[i];
    if (a.known)
      out << fmt::format("{},{},{},{:.6f},{:.5f},{:.5f},{:.5f},known\n", p.x(), p.y(), p.z(), a.distance,
                         a.gradient.x(), a.gradient.y(), a.gradient.z());
    else
      out << fmt::format("{},{},{},,,,,unknown\n", p.x(), p.y(), p.z());
  }
}

constexpr double kMaxPlaneOffset = 1e6;  // meters

struct Plane {
  int axis = 0;
  float at = 0;  // meters
};
Plane parse_plane(const std::string& text) {
  const auto value = text.size() > 2 && text[1] == '=' ? parse_quantity(text.substr(2), Unit::meters) : std::nullopt;
  if (!value || std::abs(*value) > kMaxPlaneOffset || text[0] < 'x' || text[0] > 'z')
    throw CLI::ValidationError("--slice", "'" + text + "' is not a plane, for example z=0.5 or z=50cm");
  return {text[0] - 'x', static_cast<float>(*value)};
}

Band parse_band(const std::string& text) {
  const auto [low, high] = heights_in(text);
  return {static_cast<float>(low), static_cast<float>(high)};
}

/// Returns the .yaml of a costmap; the user may also name its .pgm picture.
fs::path costmap_file(const fs::path& named) {
  const std::string extension = extension_of(named);
  if (extension == ".yaml" || extension == ".yml") return named;
  if (extension == ".pgm") return fs::path(named).replace_extension(".yaml");
  throw CLI::ValidationError("--costmap", named.string() + ": name X.yaml; X.pgm is written beside it");
}

/// Path of a map's grids. Throws std::runtime_error with the reason if there are none.
fs::path grids_file(const fs::path& map) {
  if (!fs::is_directory(map)) return map;
  if (fs::exists(map / "map.vdb")) return map / "map.vdb";
  const std::string folder = map.string();
  if (fs::exists(map / "session" / "state.cbor"))
    throw std::runtime_error(
        fmt::format("{0}: has no map.vdb, since its run was interrupted: resume with cairn reconstruct RECORDING -o "
                    "{1} --resume, or export the frames so far with cairn export {1} -o {2}",
                    folder, quoted(map), quoted(map / "map.vdb")));
  throw std::runtime_error(folder + ": has no map.vdb; name a folder written by reconstruct, live or merge");
}

bool is_grid(const fs::path& output) { return extension_of(output) == ".vdb"; }

struct Outputs {
  std::optional<fs::path> grid, table;
};
Outputs classify_outputs(const Arguments& a) {
  Outputs outputs;
  for (const fs::path& output : a.outputs) {
    const std::string extension = extension_of(output);
    if (is_grid(output))
      outputs.grid = output;
    else if (extension == ".csv" && !a.query.empty())
      outputs.table = output;
    else
      throw std::runtime_error(output.string() + (extension == ".csv"
                                                      ? ": answers need query points, give --query POINTS.csv"
                                                      : ": unknown kind of file; use .vdb, or .csv with --query"));
  }
  return outputs;
}

/// Camera trajectories from the map's folder.
Trajectory camera_path(const fs::path& folder, bool is_needed) {
  Trajectory visited;
  for (int recording = -1;; ++recording) {  // trajectory.txt belongs to the last recording
    const fs::path file = folder / (recording < 0 ? "trajectory.txt" : name_of_trajectory(recording));
    if (!fs::exists(file)) break;
    const Trajectory poses = read_trajectory(file);
    visited.insert(visited.end(), poses.begin(), poses.end());
  }
  if (visited.empty() && is_needed)
    throw std::runtime_error((folder / "trajectory.txt").string() +
                             ": is missing: --robot-radius needs the camera positions");
  return visited;
}

/// A map, or a cell of a map, to query.
struct Source {
  std::function<Map&()> map;  // loads it
  std::function<void(Up)> set_up_axis;
  std::function<bool(const Eigen::Vector3f&)> contains;  // empty: all points
  std::function<std::shared_ptr<const DistanceField>(const std::shared_ptr<const DistanceField>&)> crop;
};

/// Queries of the command and their results, for one map or for several cells in turn.
class EsdfQueries {
 public:
  explicit EsdfQueries(const Arguments& a);
  /// Answers the queries for a source. Skips sources without queries unless `always`. Returns false if skipped.
  bool add(Source source, Trajectory visited, bool always);
  void write() const;

 private:
  /// True if a query other than points is requested, or if a query point is in the source.
  [[nodiscard]] bool needs(const std::function<bool(const Eigen::Vector3f&)>& contains) const;
  void answer(const DistanceField& field, const std::function<bool(const Eigen::Vector3f&)>& contains);
  void print_summary() const;
  const Arguments& a_;
  Outputs outputs_;
  Plane plane_;
  std::vector<fs::path> costmaps_;
  std::vector<Eigen::Vector3f> points_;
  std::vector<DistanceField::Answer> answers_;
  std::optional<Costmap> costmap_;
  std::shared_ptr<const DistanceField> field_;  // of the latest source
  std::size_t voxels_ = 0;                      // known voxels
  Eigen::AlignedBox3f box_;                     // bounds of the known voxels
  double seconds_ = 0, query_seconds_ = 0;      // for computing fields, and for queries
};

/// Checks all arguments before the work starts.
EsdfQueries::EsdfQueries(const Arguments& a) : a_(a), outputs_(classify_outputs(a)) {
  if (!a.slice.empty()) plane_ = parse_plane(a.slice[0]);
  if (!a.costmaps.empty() && a.height.empty())
    throw CLI::ValidationError("--costmap", "needs --height LOW:HIGH, the robot's lowest and highest point");
  for (const fs::path& named : a.costmaps) costmaps_.push_back(costmap_file(named));
  if (!a.slice.empty() && extension_of(a.slice[1]) != ".png")
    throw CLI::ValidationError("--slice", a.slice[1] + ": is written as PNG, name X.png");
  if (!costmaps_.empty()) costmap_.emplace(parse_band(a.height));
  if (!a.query.empty()) points_ = read_query_points(a.query);
  answers_.resize(points_.size());
}

bool EsdfQueries::needs(const std::function<bool(const Eigen::Vector3f&)>& contains) const {
  return a_.query.empty() || costmap_ || std::any_of(points_.begin(), points_.end(), contains);
}

void EsdfQueries::answer(const DistanceField& field, const std::function<bool(const Eigen::Vector3f&)>& contains) {
  std::vector<std::size_t> indices;
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (!contains || contains(points_[i])) {
      indices.push_back(i);
      points.push_back(points_[i]);
    }
  std::vector<DistanceField::Answer> answers(points.size());
  const auto start = Clock::now();
  field.query(points, answers);
  query_seconds_ += seconds_since(start);
  for (std::size_t i = 0; i < indices.size(); ++i) answers_[indices[i]] = answers[i];
}

bool EsdfQueries::add(Source source, Trajectory visited, bool always) {
  const auto start = Clock::now();
  if (a_.up) {
    const Eigen::Quaterniond before = source.map().upright().world_from_tracked;
    source.set_up_axis(*a_.up);
    const Eigen::Isometry3d rotation(source.map().upright().world_from_tracked * before.conjugate());
    for (StampedPose& pose : visited) pose.world_from_camera = rotation * pose.world_from_camera;
  }
  if (!always && !needs(source.contains)) return false;
  EsdfOptions options = a_.esdf;
  options.robot_radius = a_.robot_radius.value_or(options.robot_radius);
  Map& map = source.map();
  const auto field = map.distances(options, visited);
  field_ = source.crop ? source.crop(field) : field;
  if (const GravityAlignment upright = map.upright(); costmap_ && !upright.known && voxels_ == 0)
    spdlog::warn("{}: may be tilted, since the gravity direction is {}", a_.costmaps[0].string(),
                 with_flag_names(upright.description));
  seconds_ += seconds_since(start);
  for (const auto& [block, samples] : field_->blocks())
    voxels_ += static_cast<std::size_t>(
        std::count_if(samples->begin(), samples->end(), [](float d) { return !std::isnan(d); }));
  const Eigen::AlignedBox3f box = field_->bounds();
  box_.extend(box);
  answer(*field, source.contains);
  if (costmap_) costmap_->add(*field, map.mesh(), box, source.contains);
  return true;
}

void EsdfQueries::write() const {
  if (outputs_.grid) write_distances(*outputs_.grid, *field_);
  if (outputs_.table)
    write_whole(*outputs_.table, [&](std::ostream& out) { write_csv(out, points_, answers_); });
  else if (!a_.query.empty())
    write_csv(std::cout, points_, answers_);
  if (!a_.slice.empty()) write_slice(a_.slice[1], *field_, plane_.axis, plane_.at);
  for (const fs::path& costmap : costmaps_) costmap_->write(costmap);
  if (a_.json || a_.query.empty() || outputs_.table) print_summary();
}

void EsdfQueries::print_summary() const {
  const auto known = std::count_if(answers_.begin(), answers_.end(), [](const auto& answer) { return answer.known; });
  if (a_.json) {
    const nlohmann::json j{{"voxel_size", field_->voxel_size()},
                           {"max_distance", field_->max_distance()},
                           {"known_voxels", voxels_},
                           {"low", {box_.min().x(), box_.min().y(), box_.min().z()}},
                           {"high", {box_.max().x(), box_.max().y(), box_.max().z()}},
                           {"seconds", seconds_},
                           {"points", points_.size()},
                           {"known_points", known},
                           {"query_seconds", query_seconds_}};
    fmt::print("{}\n", format_json(j, 2));
    return;
  }
  const auto corner = [](const Eigen::Vector3f& p) { return fmt::format("{:.2f} {:.2f} {:.2f}", p.x(), p.y(), p.z()); };
  print_result("{} voxels of {} m known, from {} to {}, in {:.2f} s\n", voxels_, field_->voxel_size(),
               corner(box_.min()), corner(box_.max()), seconds_);
  if (!points_.empty())
    print_result("{} of {} points known, {:.1f} million points/s\n", known, points_.size(),
                 1e-6 * static_cast<double>(points_.size()) / query_seconds_);
}

/// Returns true if the map's grids are stored per cell.
bool is_stored_in_cells(const Arguments& a) {
  return a.cell || (fs::exists(a.map / "plan.json") && !fs::exists(a.map / "map.vdb"));
}

/// Queries the cells of a project in turn.
void query_cells(const Arguments& a, EsdfQueries& answers, const Trajectory& visited) {
  (void)read_plan(a.map);  // throws if the folder is not a project
  const auto cells = a.cell ? std::vector{*a.cell} : cells_of(a.map);
  if (cells.empty())
    throw std::runtime_error(a.map.string() + ": has no cells yet; run cairn optimize " + quoted(a.map));
  const auto query_cell = [&](const std::array<int, 3>& cell, bool always) {
    CellMap cell_map(a.map, cell, static_cast<double>(a.esdf.max_distance), a.device);
    return answers.add({.map = [&cell_map]() -> Map& { return cell_map.map(); },
                        .set_up_axis = [&cell_map](Up up) { cell_map.set_up_axis(up); },
                        .contains = [&cell_map](const Eigen::Vector3f& point) { return cell_map.contains(point); },
                        .crop = [&cell_map](const auto& field) { return cell_map.within(*field); }},
                       visited, always);
  };
  bool has_answers = false;
  for (const auto& cell : cells) has_answers = query_cell(cell, false) || has_answers;
  if (!has_answers) query_cell(cells.front(), true);  // the summary needs one field
}

/// A map folder is an input through its grids, not through its session.
void check_outputs(const Arguments& a) {
  Inputs inputs;
  inputs.add_map(a.map).add(a.map / "map.vdb").add(a.query);
  if (a.cell)
    inputs.add(a.map / "tiles" / fmt::format("{},{},{}", (*a.cell)[0], (*a.cell)[1], (*a.cell)[2]) / "map.vdb");
  for (const fs::path& output : a.outputs) inputs.check_output_file(output);
  if (!a.slice.empty()) inputs.check_output_file(a.slice[1]);
  for (const fs::path& named : a.costmaps) {
    inputs.check_output_file(named);
    inputs.check_output_file(costmap_file(named));
    inputs.check_output_file(fs::path(named).replace_extension(".pgm"));
  }
}

void esdf(const Arguments& a) {
  check_outputs(a);
  EsdfQueries answers(a);
  const bool is_radius_needed = a.robot_radius.value_or(0.0f) > 0;
  if (is_stored_in_cells(a)) {
    if (!a.cell && (!a.slice.empty() || std::any_of(a.outputs.begin(), a.outputs.end(), is_grid)))
      throw CLI::ValidationError("--cell",
                                 "grids and slices of a project are written per cell: give X,Y,Z, one of those in " +
                                     (a.map / "cells").string());
    query_cells(a, answers, camera_path(a.map, is_radius_needed));
  } else {
    const fs::path vdb = grids_file(a.map);
    Trajectory visited = camera_path(vdb.parent_path().empty() ? fs::path(".") : vdb.parent_path(), is_radius_needed);
    Map map = Map::open(vdb, a.device);
    answers.add({.map = [&map]() -> Map& { return map; },
                 .set_up_axis = [&map](Up up) { map.set_up_axis(up); },
                 .contains = {},
                 .crop = {}},
                std::move(visited), true);
  }
  answers.write();
}

}  // namespace

void add_esdf(CLI::App& program) {
  auto* command = program.add_subcommand(
      "esdf", "Compute distances to the nearest surface: grids, point queries, slices, costmaps");
  const auto a = std::make_shared<Arguments>();
  command->add_option("MAP", a->map, "map.vdb, its folder, or a project whose cells have been tiled")
      ->required()
      ->check(CLI::ExistingPath);
  add_cell(
      *command, [a](const std::array<int, 3>& cell) { a->cell = cell; },
      "Only this cell of a project, from PLAN/tiles; point queries and costmaps do not need it");
  command
      ->add_option("-o,--output", a->outputs,
                   "X.vdb: the grid `esdf`. X.csv with --query: x,y,z,distance,gx,gy,gz,state")
      ->expected(1, 2)
      ->type_name(kFile);
  add_number(*command, "--max-distance", a->esdf.max_distance, range_of("esdf.max_distance"), Unit::meters,
             "Maximum distance; larger distances are clamped")
      ->capture_default_str();
  add_number(*command, "--esdf-voxel-size", a->esdf.voxel_size, range_of("esdf.voxel_size"), Unit::meters,
             "Voxel of the distance field: 1, 2, 4 or 8 voxels of the map; 0: two [two]");
  add_number(*command, "--robot-radius", a->robot_radius, range_of("esdf.robot_radius"), Unit::meters,
             "Radius of the free space around each camera position, where the map is unobserved [0.1]");
  command->add_option("--query", a->query, "CSV file of points, header x,y,z, meters in the map's frame")
      ->check(CLI::ExistingFile);
  command->add_option("--slice", a->slice, "Plane and picture, for example y=0.5 slice.png")
      ->expected(2)
      ->type_name("PLANE PNG");
  command->add_option("--costmap", a->costmaps,
                      "X.yaml: occupancy for ROS map_server, with X.pgm beside it. ROS axes: x is the map's z, y its "
                      "-x, up its -y");
  command->add_option("--height", a->height,
                      "LOW:HIGH, height range of the costmap in meters above the first camera, along gravity if its "
                      "direction is known (see report.json)");
  add_up(*command, a->up);
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { esdf(*a); });
}

}  // namespace cairn::apps
