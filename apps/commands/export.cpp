// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/export.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <cstdio>
#include <filesystem>
#include <iterator>
#include <memory>
#include <sstream>

#include "base/file_name.hpp"
#include "base/no_texture.hpp"
#include "base/quoted.hpp"
#include "cairn/mapping/floor_plan.hpp"
#include "cairn/mapping/map.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/export_options.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/json_text.hpp"
#include "cli/output_folder.hpp"
#include "cli/outputs.hpp"
#include "cli/plan_info.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"
#include "cli/recording_names.hpp"
#include "cli/sources.hpp"
#include "options/option_ranges.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path map, output;
  MeshArguments options;
  std::optional<ViewsFor> program;
  PlanOptions plan;
  bool plan_requested = false;  // set by options that only a floor plan has
  std::optional<Up> up;
  int images = 0;
  int device = -1;
  bool json = false;
};

GeoPlace parse_geo(const std::string& text) {
  GeoPlace place;
  double* const parts[] = {&place.latitude, &place.longitude, &place.height, &place.heading};
  std::istringstream parts_text(text);
  std::size_t count = 0;
  bool is_valid = !text.ends_with(',');
  for (std::string word; std::getline(parts_text, word, ','); ++count) {
    const auto value = parse_quantity(word, count == 2 ? Unit::meters : Unit::none);
    is_valid = is_valid && count < std::size(parts) && value;
    if (is_valid) *parts[count] = *value;
  }
  if (!is_valid || count != std::size(parts))
    throw CLI::ValidationError("--geo",
                               "'" + text + "' is not LAT,LON,HEIGHT,HEADING, for example 48.137,11.575,519,90");
  return place;
}

Map open_map(const Arguments& a) {
  Map map = Map::open(a.map, a.device);
  if (a.up) map.set_up_axis(*a.up);
  return map;
}

int parse_scale(const std::string& text) {
  const AllowedRange range{1, export_range_of("PlanOptions::scale").max};
  const auto scale = parse_whole(text.starts_with("1:") ? text.substr(2) : text);
  if (!scale || !range.has(static_cast<double>(*scale)))
    throw CLI::ValidationError(
        "--scale", fmt::format("'{}' is not a scale from 1 to {}, for example 100 or 1:100", text, range.max));
  return static_cast<int>(*scale);
}

constexpr float kLasSpacing = 0.01f;  // meters, default of --points for .las

bool is_floor_plan(const fs::path& file) {
  const std::string extension = extension_of(file);
  return extension == ".svg" || extension == ".pdf" || extension == ".dxf" || extension == ".ifc";
}

bool has_session(const fs::path& map) { return fs::exists(map / "session" / "state.cbor"); }

/// Throws if an option needs the map's folder but MAP is only a map.vdb.
void require_folder(const Arguments& a) {
  const bool needs_keyframes = a.options.texture_requested || a.options.cameras || a.program;
  if (!needs_keyframes || fs::is_directory(a.map)) return;
  const fs::path folder = a.map.parent_path().empty() ? fs::path(".") : a.map.parent_path();
  const std::string option_name = a.program ? "--for" : a.options.cameras ? "--cameras" : "--texture";
  if (has_session(folder))
    throw std::runtime_error(
        fmt::format("{}: has no keyframes, which {} needs: use the folder {}: cairn export {} -o {} {}", a.map.string(),
                    option_name, folder.string(), quoted(folder), quoted(a.output),
                    option_name == "--for" ? "--for ..." : option_name));
}

ExportReport export_mesh_file(const Arguments& a) {
  MeshArguments options = a.options;
  options.source = tidy(a.map).filename().string();
  check(options.for_file(a.output), a.output);
  Progress progress(std::nullopt, "");
  return export_mesh(open_map(a), a.output, options, export_progress(progress));
}

/// Exports grids from a session; an interrupted run has no map.vdb yet.
void export_grids(const Arguments& a) {
  if (!has_session(a.map))
    throw std::runtime_error(a.map.string() + ": has no session to export grids from; a map.vdb already contains them");
  open_map(a).write_grids(a.output, a.options.axes);
  print_result("{}  {}\n", a.output.string(), format_size(fs::file_size(a.output)));
}

nlohmann::json to_storey_json(const ExportedStorey& s, bool with_coverage) {
  nlohmann::json json{{"floor_m", s.floor},    {"floor_area_m2", s.floor_area}, {"rooms_m2", s.rooms},
                      {"walls_m", s.walls},    {"mean_off_m", s.mean_off},      {"p95_off_m", s.p95_off},
                      {"max_off_m", s.max_off}};
  if (with_coverage)
    json.update({{"not_looked_at_m2", s.unobserved_area}, {"not_looked_at_share", s.unobserved_share}});
  return json;
}

nlohmann::json file_sizes(const std::vector<fs::path>& files) {
  auto sizes = nlohmann::json::array();
  for (const fs::path& file : files) sizes.push_back({{"file", file.string()}, {"bytes", fs::file_size(file)}});
  return sizes;
}

/// Recording names if MAP is a project, else empty.
std::vector<std::string> recordings_of(const fs::path& map) {
  if (!fs::exists(map / "plan.json")) return {};
  return short_names(recordings_in(map));
}

void print(const ExportedPlan& e, const PlanOptions& options) {
  for (const fs::path& file : e.files) {
    const std::string page = e.paper.empty() ? fmt::format("{:.0f} mm x {:.0f} mm", e.width_mm, e.height_mm) : e.paper;
    print_result("{}  {}{}\n", file.string(), format_size(fs::file_size(file)),
                 extension_of(file) == ".ifc" ? "" : fmt::format(", 1:{} on {}", e.scale, page));
  }
  for (std::size_t i = 0; i < e.storeys.size(); ++i) {
    const ExportedStorey& s = e.storeys[i];
    print_result(
        "storey {}  floor at {:.2f} m, {:.1f} m2 observed{}; lines are {:.0f} mm from the map's surface on average, 95 "
        "% of {:.0f} m within {:.0f} mm\n",
        i + 1, s.floor, s.floor_area,
        s.rooms.empty() ? "" : fmt::format(", closed rooms of {:.1f} m2", fmt::join(s.rooms, ", ")), 1e3 * s.mean_off,
        s.walls, 1e3 * s.p95_off);
    if (options.coverage)
      print_result("storey {}  {:.1f} m2 within its outline are unobserved, {:.1f} % of the floor\n", i + 1,
                   s.unobserved_area, 100 * s.unobserved_share);
  }
  if (options.loops) print_result("loops     {}, of these {} between two recordings\n", e.loops, e.loops_between);
}

void export_plan(const Arguments& a) {
  PlanOptions options = a.plan;
  if (options.title.empty()) options.title = tidy(a.map).filename().string();
  options.recordings = recordings_of(a.map);
  if (is_project_folder(a.map)) options.missing = missing_recordings(a.map);
  if (!options.missing.empty())
    spdlog::warn(fmt::format("{}: {} of {} recordings of the project are missing or incomplete in the map: {}",
                             a.map.string(), options.missing.size(), options.recordings.size(),
                             fmt::join(options.missing, ", ")));
  check(options, a.output);
  Progress progress(std::nullopt, "");
  const ExportedPlan e = open_map(a).export_plan(a.output, options, export_progress(progress));
  progress.clear();
  if (!a.json) return print(e, options);
  auto storeys = nlohmann::json::array();
  for (const ExportedStorey& s : e.storeys) storeys.push_back(to_storey_json(s, options.coverage));
  nlohmann::json json{{"scale", e.scale},         {"paper", e.paper},   {"width_mm", e.width_mm},
                      {"height_mm", e.height_mm}, {"storeys", storeys}, {"files", file_sizes(e.files)}};
  if (is_project_folder(a.map)) json["missing_recordings"] = options.missing;
  if (options.loops) json["loops"] = {{"drawn", e.loops}, {"between_recordings", e.loops_between}};
  fmt::print("{}\n", format_json(json, 2));
}

std::uintmax_t folder_size(const fs::path& folder) {
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) bytes += entry.file_size();
  return bytes;
}

void export_views(const Arguments& a) {
  ViewsOptions options{.program = *a.program, .images = a.images};
  if (a.options.point_spacing > 0) options.point_spacing = a.options.point_spacing;
  Progress progress(std::nullopt, "");
  const ExportViewsReport e = open_map(a).export_views(a.output, options, export_progress(progress));
  progress.clear();
  if (a.json)
    fmt::print("{}\n", format_json({{"images", e.images}, {"keyframes", e.keyframes}, {"points", e.points}}, 2));
  else
    print_result("{}  {}, {} images of {} keyframes, {} points\n", a.output.string(),
                 format_size(folder_size(a.output)), e.images, e.keyframes, format_count(e.points));
}

/// Prints sizes of the files written beside the requested file.
void print_other_files(const std::vector<fs::path>& files) {
  constexpr std::size_t kMaxLines = 8;
  if (files.size() > kMaxLines + 1) {
    std::uintmax_t bytes = 0;
    for (std::size_t i = 1; i < files.size(); ++i) bytes += fs::file_size(files[i]);
    print_result("{}  {} in {} files\n", (files.back().parent_path() / "").string(), format_size(bytes),
                 files.size() - 1);
    return;
  }
  for (std::size_t i = 1; i < files.size(); ++i)
    print_result("{}  {}\n", files[i].string(), format_size(fs::file_size(files[i])));
}

void print(const Arguments& a, const ExportReport& e) {
  double seconds = 0;
  for (const auto& [stage, ms] : e.stage_ms) seconds += 1e-3 * ms;
  const std::string head = fmt::format("{}  {}", a.output.string(), format_size(fs::file_size(a.output)));
  if (e.points > 0)
    print_result("{}, {} points in {:.1f} s\n", head, format_count(e.points), seconds);
  else
    print_result("{}, {} triangles{}{} in {:.1f} s\n", head, format_count(e.triangles),
                 e.triangles < e.full_triangles ? " of " + format_count(e.full_triangles) : "",
                 e.tiles > 0            ? fmt::format(" in {} tiles", e.tiles)
                 : a.options.levels > 1 ? ", levels of detail"
                                        : "",
                 seconds);
  print_other_files(e.files);
  if (e.components_removed + e.holes_filled > 0)
    print_result("clean     {} floating components removed, {} holes filled\n", e.components_removed, e.holes_filled);
  if (e.error > 0) print_result("simplify  {:.1f} mm at most\n", 1e3 * static_cast<double>(e.error));
  if (e.textures > 0)
    print_result("texture   {} texels of {:.1f} mm in {} charts, {:.1f} % of them observed by {} keyframes\n",
                 format_count(e.texels), 1e3 * static_cast<double>(e.texel),
                 format_count(static_cast<std::uint64_t>(e.charts)), 100 * e.textured_share, e.keyframes);
}

/// Checks the output and the files beside it against the inputs.
void check_outputs(const Arguments& a) {
  const Inputs inputs = Inputs().add_map(a.map);
  if (a.program) return inputs.check_output_folder(a.output);
  const auto beside = [&](const char* extension) { return fs::path(a.output).replace_extension(extension); };
  inputs.check_output_file(a.output);
  const std::string extension = extension_of(a.output);
  if (extension == ".json") inputs.check_output_folder(beside(".tiles"));
  if (extension == ".gltf") inputs.check_output_file(beside(".bin"));
  if (extension == ".obj") inputs.check_output_file(beside(".mtl"));
}

void run_export(const Arguments& a) {
  if (a.plan_requested && (a.program || !is_floor_plan(a.output)))
    throw CLI::ValidationError("--output", a.output.string() +
                                               ": --scale, --height, --path, --loops, --coverage and --title "
                                               "are for floor plans, X.svg, X.pdf, X.dxf and X.ifc");
  check_outputs(a);
  if (const fs::path folder = a.output.parent_path(); !folder.empty()) prepare_output(folder);
  require_folder(a);
  if (a.program) return export_views(a);
  if (extension_of(a.output) == ".vdb") return export_grids(a);
  if (is_floor_plan(a.output)) return export_plan(a);
  const ExportReport e = export_mesh_file(a);
  if (a.json) {
    nlohmann::json json = to_json(e);
    json["files"] = file_sizes(e.files);
    fmt::print("{}\n", format_json(json, 2));
    return;
  }
  print(a, e);
}

}  // namespace

ExportOptions MeshArguments::for_file(const fs::path& file) const {
  ExportOptions options = *this;
  const std::string extension = extension_of(file);
  const bool may_have_texture = extension != ".ply" && extension != ".stl" && extension != ".las" && point_spacing <= 0;
  if (extension == ".las" && options.point_spacing <= 0) options.point_spacing = kLasSpacing;
  options.texture.enabled = texture_requested || (may_have_texture && !no_texture);
  return options;
}

ExportReport with_texture_if_any(const MeshArguments& arguments, const fs::path& file,
                                 const std::function<ExportReport(const ExportOptions&)>& write) {
  ExportOptions options = arguments.for_file(file);
  try {
    return write(options);
  } catch (const NoTexture&) {
    if (arguments.texture_requested) throw;
    options.texture.enabled = false;
    return write(options);
  }
}

ExportReport export_mesh(Map map, const fs::path& file, const MeshArguments& arguments,
                         const ExportProgress& progress) {
  return with_texture_if_any(arguments, file,
                             [&](const ExportOptions& options) { return map.export_mesh(file, options, progress); });
}

void add_up(CLI::App& command, std::optional<Up>& up) {
  command
      .add_option_function<std::string>(
          "--up", [&up](const std::string& name) { up = parse_up(name); },
          "Up axis, if the gravity direction of the map is unknown: auto, camera, or an axis of the given poses or of "
          "the first camera: x, y, z, -x, -y, -z; rotates the output as reconstruct --up does")
      ->check(CLI::IsMember({"auto", "camera", "x", "y", "z", "-x", "-y", "-z"}));
}

void add_export_options(CLI::App& command, MeshArguments& o) {
  constexpr const char* kGroup = "Mesh";
  const auto option = [&](const char* name, auto& value, const char* field, Unit unit, const char* help) {
    return add_number(command, name, value, export_range_of(field), unit, help)->capture_default_str()->group(kGroup);
  };
  auto* ratio =
      option("--simplify", o.simplify.ratio, "SimplifyOptions::ratio", Unit::share, "Ratio of triangles to keep");
  auto* max_error =
      option("--max-error", o.simplify.max_error, "SimplifyOptions::max_error", Unit::meters,
             "Maximum deviation of the surface by simplification; 0: as needed for --simplify, at most two voxels");
  add_number(command, "--triangles", o.simplify.triangles, export_range_of("SimplifyOptions::triangles"),
             "Maximum number of triangles, whatever the deviation of the surface [all]")
      ->excludes(ratio)
      ->excludes(max_error)
      ->group(kGroup);
  option("--min-piece", o.clean.min_component, "CleanOptions::min_component", Unit::meters,
         "Remove smaller floating components");
  option("--min-weight", o.clean.min_weight, "CleanOptions::min_weight", Unit::none,
         "Observations at 1 m; surface with less weight is removed");
  option("--fill-holes", o.clean.fill_holes, "CleanOptions::fill_holes", Unit::meters, "Close smaller holes");
  auto* none =
      command.add_flag("--no-texture", o.no_texture,
                       "Use the voxels' colors instead of a texture from the keyframes [texture if there is color]");
  none->group(kGroup);
  const auto texture_option = [&](CLI::Option* one) {
    one->excludes(none)->each([&o](const std::string&) { o.texture_requested = true; });
  };
  auto* texture =
      command.add_flag("--texture", o.texture_requested, "Require a texture: an error if it cannot be made");
  texture->excludes(none)->group(kGroup);
  texture_option(option("--texel", o.texture.texel, "TextureOptions::texel", Unit::meters,
                        "Side of a texel; 0: resolution of the keyframes, if it fits"));
  texture_option(option("--texture-size", o.texture.max_size, "TextureOptions::max_size", Unit::pixels,
                        "Maximum side of a texture"));
  texture_option(command.add_option("--texture-format", o.texture.png, "jpeg or png [jpeg]")
                     ->transform(one_of<bool>({{"jpeg", false}, {"png", true}}))
                     ->group(kGroup));
  texture_option(option("--jpeg-quality", o.texture.jpeg_quality, "TextureOptions::jpeg_quality", Unit::none,
                        "JPEG quality of textures; higher means larger files"));
  command
      .add_option("--compress", o.compression,
                  "glTF: none, quantized (KHR_mesh_quantization), meshopt (EXT_meshopt_compression) or draco "
                  "(KHR_draco_mesh_compression) [none]")
      ->transform(one_of<Compression>({{"none", Compression::none},
                                       {"quantized", Compression::quantized},
                                       {"meshopt", Compression::meshopt},
                                       {"draco", Compression::draco}}))
      ->group(kGroup);
  option("--cell-size", o.cell_size, "ExportOptions::cell_size", Unit::meters,
         "Side of a cell: one node in glTF, one tile in 3D Tiles; 0: by the map's size");
  command
      .add_flag(
          "--lit", o.lit,
          "glTF: shaded by the viewer's lights, for programs that show KHR_materials_unlit in white (VTK 9.1, f3d 1.3)")
      ->group(kGroup);
  command.add_flag("--cameras", o.cameras, "glTF: the camera's path as a line, and a camera for each keyframe")
      ->group(kGroup);
}

namespace {

void add_plan_options(CLI::App& command, const std::shared_ptr<Arguments>& a) {
  constexpr const char* kGroup = "Floor plan";
  const auto plan_option = [&](CLI::Option* one) {
    one->group(kGroup)->each([a](const std::string&) { a->plan_requested = true; });
  };
  plan_option(command
                  .add_option_function<std::string>(
                      "--scale", [a](const std::string& text) { a->plan.scale = parse_scale(text); },
                      "N of 1:N, on the smallest fitting paper from A4 to A0, or a larger one [50 if it fits on A3, "
                      "else 100, 200 or 500 if it fits on A0]")
                  ->type_name("SCALE"));
  plan_option(add_number(command, "--height", a->plan.height, export_range_of("PlanOptions::height"), Unit::meters,
                         "Height above each floor at which walls are cut")
                  ->capture_default_str());
  plan_option(command.add_flag("--path", a->plan.path, "Also draw the camera's path, each recording in its own color"));
  plan_option(command.add_flag("--loops", a->plan.loops, "Also draw loop closures as lines"));
  plan_option(command.add_flag("--coverage", a->plan.coverage,
                               "Mark unobserved areas within the building's outline, and print their size"));
  plan_option(command.add_option("--title", a->plan.title, "Title on the plan [the map's folder]"));
}

}  // namespace

void add_export(CLI::App& program) {
  auto* command = program.add_subcommand(
      "export", "Write a map's mesh, cleaned, simplified, textured or compressed, or a floor plan");
  const auto a = std::make_shared<Arguments>();
  command->add_option("MAP", a->map, "Folder written by reconstruct, live or merge, or its map.vdb")
      ->required()
      ->check(CLI::ExistingPath);
  command
      ->add_option(
          "-o,--output", a->output,
          "X.glb, X.gltf, X.ply, X.obj, X.usdz, X.stl: for printing, meters, z up, X.las: points, tileset.json: 3D "
          "Tiles 1.1 with "
          "levels of detail, X.vdb: the grids, X.pdf, X.svg, X.dxf: a floor plan to scale, X.ifc: a building model, "
          "with a page, or X-1.svg, X-2.svg, for each storey, or with --for a new folder")
      ->required()
      ->type_name(kPath);
  add_export_options(*command, a->options);
  add_number(
      *command, "--points", a->options.point_spacing,
      {.min = 0, .max = export_range_of("ExportOptions::point_spacing").max, .is_open = true}, Unit::meters,
      "X.ply, X.las: points with this spacing, no triangles; with --for, the initial points of the program [0.02]")
      ->group("Mesh");
  add_number(*command, "--lods", a->options.levels, export_range_of("ExportOptions::levels"),
             "Levels of detail, each with a quarter of the triangles: X.glb, X.lod1.glb, ...")
      ->capture_default_str()
      ->group("Mesh");
  command
      ->add_option(
          "--frame", a->options.axes,
          "world (x right, y down, z forward), yup or zup, independent of the format [glTF and OBJ yup, STL and 3D "
          "Tiles zup, PLY and VDB world]")
      ->transform(one_of<Axes>({{"world", Axes::world}, {"yup", Axes::y_up}, {"zup", Axes::z_up}}))
      ->group("Mesh");
  add_up(*command, a->up);
  command
      ->add_option_function<std::string>(
          "--geo", [a](const std::string& text) { a->options.geo = parse_geo(text); },
          "LAT,LON,HEIGHT,HEADING: position of a tileset's origin on the Earth (WGS 84, degrees, meters), and heading "
          "of the map's z axis, in degrees clockwise from north")
      ->type_name("PLACE")
      ->group("Mesh");
  add_plan_options(*command, a);
  auto* program_name =
      command
          ->add_option("--for", a->program,
                       "nerfstudio or colmap: keyframes as images with poses and depth, and points of the surface")
          ->transform(one_of<ViewsFor>({{"nerfstudio", ViewsFor::nerfstudio}, {"colmap", ViewsFor::colmap}}))
          ->group("Images");
  add_number(*command, "--images", a->images, export_range_of("ViewsOptions::images"),
             "With --for: maximum number of images, the sharpest of their neighborhood; 0: all")
      ->needs(program_name)
      ->capture_default_str()
      ->group("Images");
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { run_export(*a); });
}

}  // namespace cairn::apps
