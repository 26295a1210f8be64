// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "cairn/atomic_file.hpp"
#include "cairn/file_name.hpp"
#include "cairn/map.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "export_options.hpp"
#include "flags.hpp"
#include "json_text.hpp"
#include "output_folder.hpp"
#include "pictures.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Arguments {
  fs::path map;
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

void write_answers(std::ostream& out, const std::vector<Eigen::Vector3f>& points,
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

/// The number that a word is, also nan or inf; nothing if it is none.
std::optional<float> number_in(std::string_view word) {
  float value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

struct Plane {
  int axis = 0;
  float at = 0;  // metres
};
Plane parse_plane(const std::string& text) {
  const auto value = text.size() > 2 && text[1] == '=' ? number_in(std::string_view(text).substr(2)) : std::nullopt;
  if (!value || !std::isfinite(*value) || text[0] < 'x' || text[0] > 'z')
    throw CLI::ValidationError("--slice", "'" + text + "' is no plane, for example z=0.5");
  return {text[0] - 'x', *value};
}

Band parse_band(const std::string& text) {
  const std::size_t colon = text.find(':');
  const auto low = number_in(std::string_view(text).substr(0, colon));
  const auto high = colon == std::string::npos ? std::nullopt : number_in(std::string_view(text).substr(colon + 1));
  if (!low || !high || !(*low < *high))
    throw CLI::ValidationError("--height", "'" + text + "' is not LOW:HIGH, for example -1.2:0.3");
  return {*low, *high};
}

/// A costmap is its .yaml, and a picture beside it, which may be named as well.
fs::path costmap_file(const fs::path& named) {
  const std::string extension = extension_of(named);
  if (extension == ".yaml" || extension == ".yml") return named;
  if (extension == ".pgm") return fs::path(named).replace_extension(".yaml");
  throw CLI::ValidationError("--costmap", named.string() + ": name X.yaml, which gets X.pgm beside it");
}

/// The grids of a map, or why there are none.
fs::path grids_of(const fs::path& map) {
  if (!fs::is_directory(map)) return map;
  if (fs::exists(map / "map.vdb")) return map / "map.vdb";
  const std::string folder = map.string();
  if (fs::exists(map / "session" / "state.cbor"))
    throw std::runtime_error(
        fmt::format("{0}: has no map.vdb, since its run was cut off: go on with cairn reconstruct RECORDING -o {0} "
                    "--resume, or make it from what came so far with cairn export {0} -o {1}",
                    folder, (map / "map.vdb").string()));
  throw std::runtime_error(folder + ": has no map.vdb; name the folder that reconstruct, live or merge has made");
}

struct Outputs {
  std::optional<fs::path> grid, table;
};
Outputs sort_outputs(const Arguments& a) {
  Outputs outputs;
  for (const fs::path& output : a.outputs) {
    const std::string extension = extension_of(output);
    if (extension == ".vdb")
      outputs.grid = output;
    else if (extension == ".csv" && !a.query.empty())
      outputs.table = output;
    else
      throw std::runtime_error(output.string() + (extension == ".csv"
                                                      ? ": answers need questions, give --query POINTS.csv"
                                                      : ": unknown kind of file; take .vdb, or .csv with --query"));
  }
  return outputs;
}

struct Asked {
  std::size_t points = 0, known = 0;
  double seconds = 0;
};
/// Answers go to a table, or else to the standard output.
Asked answer(const DistanceField& field, const std::vector<Eigen::Vector3f>& points,
             const std::optional<fs::path>& table) {
  std::vector<DistanceField::Answer> answers(points.size());
  const auto start = Clock::now();
  field.query(points, answers);
  Asked asked{.points = points.size(), .seconds = seconds_since(start)};
  for (const auto& a : answers) asked.known += a.known;
  if (table)
    write_whole(*table, [&](std::ostream& out) { write_answers(out, points, answers); });
  else
    write_answers(std::cout, points, answers);
  return asked;
}

/// `seconds`: that making the field took.
void print_summary(const DistanceField& field, double seconds, const Asked& asked, bool as_json) {
  std::size_t voxels = 0;
  for (const auto& [block, samples] : field.blocks())
    for (const float d : *samples) voxels += !std::isnan(d);
  const Eigen::AlignedBox3f box = field.bounds();
  if (as_json) {
    const nlohmann::json j{{"voxel_size", field.voxel_size()},
                           {"max_distance", field.max_distance()},
                           {"known_voxels", voxels},
                           {"low", {box.min().x(), box.min().y(), box.min().z()}},
                           {"high", {box.max().x(), box.max().y(), box.max().z()}},
                           {"seconds", seconds},
                           {"points", asked.points},
                           {"known_points", asked.known},
                           {"query_seconds", asked.seconds}};
    fmt::print("{}\n", text_of(j, 2));
    return;
  }
  const auto corner = [](const Eigen::Vector3f& p) { return fmt::format("{:.2f} {:.2f} {:.2f}", p.x(), p.y(), p.z()); };
  say("{} voxels of {} m known, from {} to {}, in {:.2f} s\n", voxels, field.voxel_size(), corner(box.min()),
      corner(box.max()), seconds);
  if (asked.points > 0)
    say("{} of {} points known, {:.1f} million points/s\n", asked.known, asked.points,
        1e-6 * static_cast<double>(asked.points) / asked.seconds);
}

/// Where the camera was, as the run that made the map has written it beside map.vdb.
Trajectory visited_of(const fs::path& vdb, bool is_needed) {
  Trajectory visited;
  const fs::path folder = vdb.parent_path().empty() ? fs::path(".") : vdb.parent_path();
  for (int recording = -1;; ++recording) {  // trajectory.txt is the last one's
    const fs::path file = folder / (recording < 0 ? "trajectory.txt" : name_of_trajectory(recording));
    if (!fs::exists(file)) break;
    const Trajectory poses = read_trajectory(file);
    visited.insert(visited.end(), poses.begin(), poses.end());
  }
  if (visited.empty() && is_needed)
    throw std::runtime_error((folder / "trajectory.txt").string() +
                             ": is missing: --robot-radius needs to know where the camera was");
  return visited;
}

void esdf(const Arguments& a) {
  // All that may be wrong in the command is told before the work begins.
  const Outputs outputs = sort_outputs(a);
  const Plane plane = a.slice.empty() ? Plane{} : parse_plane(a.slice[0]);
  if (!a.costmaps.empty() && a.height.empty())
    throw CLI::ValidationError("--costmap", "needs --height LOW:HIGH, the robot's lowest and highest point");
  std::vector<fs::path> costmaps;
  for (const fs::path& named : a.costmaps) costmaps.push_back(costmap_file(named));
  if (!a.slice.empty() && extension_of(a.slice[1]) != ".png")
    throw CLI::ValidationError("--slice", a.slice[1] + ": is written as PNG, name X.png");
  const fs::path vdb = grids_of(a.map);
  const Band band = a.costmaps.empty() ? Band{} : parse_band(a.height);
  const std::vector<Eigen::Vector3f> points =
      a.query.empty() ? std::vector<Eigen::Vector3f>{} : read_query_points(a.query);

  EsdfOptions options = a.esdf;
  options.robot_radius = a.robot_radius.value_or(options.robot_radius);
  Trajectory visited = visited_of(vdb, a.robot_radius.value_or(0.0f) > 0);

  const auto start = Clock::now();
  Map map = Map::open(vdb, a.device);
  if (a.up) {
    const Eigen::Quaterniond before = map.upright().world_from_tracked;
    map.stand_up(*a.up);
    const Eigen::Isometry3d turn(map.upright().world_from_tracked * before.conjugate());
    for (StampedPose& pose : visited) pose.world_from_camera = turn * pose.world_from_camera;
  }
  const auto field = map.distances(options, visited);
  if (const Upright upright = map.upright(); !a.costmaps.empty() && !upright.known)
    spdlog::warn("{}: may be cut askew, for which way is up is {}", a.costmaps[0].string(), in_flags(upright.words));
  const double seconds = seconds_since(start);
  if (outputs.grid) write_distances(*outputs.grid, *field);
  const Asked asked = a.query.empty() ? Asked{} : answer(*field, points, outputs.table);
  if (!a.slice.empty()) write_slice(a.slice[1], *field, plane.axis, plane.at);
  if (!costmaps.empty()) {
    const Mesh surface = map.mesh();
    for (const fs::path& costmap : costmaps) write_costmap(costmap, *field, surface, band);
  }
  if (a.json || a.query.empty() || outputs.table) print_summary(*field, seconds, asked, a.json);
}

}  // namespace

void add_esdf(CLI::App& program) {
  auto* command =
      program.add_subcommand("esdf", "Distances to the nearest surface: a grid, answers, pictures, costmaps");
  const auto a = std::make_shared<Arguments>();
  command->add_option("MAP", a->map, "map.vdb, or the folder with it")->required()->check(CLI::ExistingPath);
  command
      ->add_option("-o,--output", a->outputs,
                   "X.vdb: the grid `esdf`. X.csv with --query: x,y,z,distance,gx,gy,gz,state")
      ->expected(1, 2)
      ->type_name(kFile);
  command->add_option("--max-distance", a->esdf.max_distance, "Metres; what is farther only knows that it is")
      ->capture_default_str();
  command->add_option("--esdf-voxel-size", a->esdf.voxel_size, "Metres: 1, 2, 4 or 8 voxels of the map [two]");
  command->add_option("--robot-radius", a->robot_radius,
                      "Metres around the camera that are free wherever it was, where the map does not know more [0.1]");
  command->add_option("--query", a->query, "CSV file of points, header x,y,z, metres in the map's frame")
      ->check(CLI::ExistingFile);
  command->add_option("--slice", a->slice, "Plane and picture, for example: y=0.5 slice.png")
      ->expected(2)
      ->type_name("PLANE PNG");
  command->add_option("--costmap", a->costmaps,
                      "X.yaml: occupancy for ROS map_server, with X.pgm beside it. ROS axes: x is the map's z, y its "
                      "-x, up its -y");
  command->add_option("--height", a->height,
                      "LOW:HIGH, the band of the costmap in metres above the first camera, along gravity where the map "
                      "stands upright (see report.json)");
  add_up(*command, a->up);
  command->add_option("--device", a->device, "Vulkan device as `cairn devices` numbers them; -1 chooses")
      ->capture_default_str();
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { esdf(*a); });
}

}  // namespace cairn::apps
