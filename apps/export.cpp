// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/export.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <cstdio>
#include <filesystem>
#include <iterator>
#include <memory>
#include <sstream>

#include "cairn/file_name.hpp"
#include "cairn/floor_plan.hpp"
#include "cairn/map.hpp"
#include "cairn/no_texture.hpp"
#include "cairn/option_ranges.hpp"
#include "cairn/quoted.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "export_options.hpp"
#include "inputs_and_outputs.hpp"
#include "json_text.hpp"
#include "output_folder.hpp"
#include "outputs.hpp"
#include "plan_info.hpp"
#include "progress.hpp"
#include "quantity.hpp"
#include "recording_names.hpp"
#include "sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path map, output;
  MeshArguments options;
  std::optional<ViewsFor> program;
  PlanOptions plan;
  bool asks_for_plan = false;  // set by options that only a floor plan has
  std::optional<Up> up;
  int images = 0;
  int device = -1;
  bool json = false;
};

GeoPlace parse_geo(const std::string& text) {
  GeoPlace place;
  double* const parts[] = {&place.latitude, &place.longitude, &place.height, &place.heading};
  std::istringstream words(text);
  std::size_t count = 0;
  bool is_right = !text.ends_with(',');
  for (std::string word; std::getline(words, word, ','); ++count) {
    const auto value = parse_quantity(word, count == 2 ? Unit::metres : Unit::none);
    is_right = is_right && count < std::size(parts) && value;
    if (is_right) *parts[count] = *value;
  }
  if (!is_right || count != std::size(parts))
    throw CLI::ValidationError("--geo",
                               "'" + text + "' is not LAT,LON,HEIGHT,HEADING, for example 48.137,11.575,519,90");
  return place;
}

Map open_map(const Arguments& a) {
  Map map = Map::open(a.map, a.device);
  if (a.up) map.stand_up(*a.up);
  return map;
}

int parse_scale(const std::string& text) {
  const AllowedRange range{1, export_range_of("PlanOptions::scale").most};
  const auto scale = parse_whole(text.starts_with("1:") ? text.substr(2) : text);
  if (!scale || !range.has(static_cast<double>(*scale)))
    throw CLI::ValidationError(
        "--scale", fmt::format("'{}' is no scale from 1 to {}, for example 100 or 1:100", text, range.most));
  return static_cast<int>(*scale);
}

bool is_plan(const fs::path& file) {
  const std::string extension = extension_of(file);
  return extension == ".svg" || extension == ".pdf";
}

bool has_session(const fs::path& map) { return fs::exists(map / "session" / "state.cbor"); }

/// Throws if an option needs the map's folder but MAP is only a map.vdb.
void want_folder(const Arguments& a) {
  const bool wants_more = a.options.asks_for_texture || a.options.cameras || a.program;
  if (!wants_more || fs::is_directory(a.map)) return;
  const fs::path folder = a.map.parent_path().empty() ? fs::path(".") : a.map.parent_path();
  const std::string wish = a.program ? "--for" : a.options.cameras ? "--cameras" : "--texture";
  if (has_session(folder))
    throw std::runtime_error(fmt::format(
        "{}: has no keyframes, which {} needs: give the folder {}, cairn export {} -o {} {}", a.map.string(), wish,
        folder.string(), quoted(folder), quoted(a.output), wish == "--for" ? "--for ..." : wish));
}

Exported export_it(const Arguments& a) {
  MeshArguments options = a.options;
  options.source = tidy(a.map).filename().string();
  check(options.for_file(a.output), a.output);
  Progress progress(std::nullopt, "");
  return export_mesh(open_map(a), a.output, options, on(progress));
}

/// Exports grids from a session; an interrupted run has no map.vdb yet.
void export_grids(const Arguments& a) {
  if (!has_session(a.map))
    throw std::runtime_error(a.map.string() + ": has no session to make grids from; a map.vdb is what it would be");
  open_map(a).write_grids(a.output, a.options.axes);
  say("{}  {}\n", a.output.string(), size_in_words(fs::file_size(a.output)));
}

nlohmann::json in_json(const ExportedStorey& s, bool with_coverage) {
  nlohmann::json json{{"floor_m", s.floor},    {"floor_area_m2", s.floor_area}, {"rooms_m2", s.rooms},
                      {"walls_m", s.walls},    {"mean_off_m", s.mean_off},      {"p95_off_m", s.p95_off},
                      {"max_off_m", s.max_off}};
  if (with_coverage)
    json.update({{"not_looked_at_m2", s.not_looked_at}, {"not_looked_at_share", s.not_looked_at_share}});
  return json;
}

nlohmann::json sizes_of(const std::vector<fs::path>& files) {
  auto sizes = nlohmann::json::array();
  for (const fs::path& file : files) sizes.push_back({{"file", file.string()}, {"bytes", fs::file_size(file)}});
  return sizes;
}

/// Recording names if MAP is a plan, else empty.
std::vector<std::string> recordings_of(const fs::path& map) {
  if (!fs::exists(map / "plan.json")) return {};
  return told_apart(recordings_in(map));
}

void print(const ExportedPlan& e, const PlanOptions& options) {
  for (const fs::path& file : e.files)
    say("{}  {}, 1:{} on {}\n", file.string(), size_in_words(fs::file_size(file)), e.scale,
        e.paper.empty() ? fmt::format("{:.0f} mm x {:.0f} mm", e.width_mm, e.height_mm) : e.paper);
  for (std::size_t i = 0; i < e.storeys.size(); ++i) {
    const ExportedStorey& s = e.storeys[i];
    say("storey {}  floor at {:.2f} m, {:.1f} m2 of it seen{}; lines are {:.0f} mm from the map's surface on the mean, "
        "95 % of {:.0f} m within {:.0f} mm\n",
        i + 1, s.floor, s.floor_area,
        s.rooms.empty() ? "" : fmt::format(", closed rooms of {:.1f} m2", fmt::join(s.rooms, ", ")), 1e3 * s.mean_off,
        s.walls, 1e3 * s.p95_off);
    if (options.coverage)
      say("storey {}  nobody looked at {:.1f} m2 within its outline, {:.1f} % of the floor\n", i + 1, s.not_looked_at,
          100 * s.not_looked_at_share);
  }
  if (options.loops) say("loops     {}, of these {} between two recordings\n", e.loops, e.loops_between);
}

void export_plan(const Arguments& a) {
  PlanOptions options = a.plan;
  if (options.title.empty()) options.title = tidy(a.map).filename().string();
  options.recordings = recordings_of(a.map);
  if (holds_plan(a.map)) options.missing = missing_recordings(a.map);
  if (!options.missing.empty())
    spdlog::warn(fmt::format("{}: is a plan of which {} of {} recordings are not in the map, or not whole: {}",
                             a.map.string(), options.missing.size(), options.recordings.size(),
                             fmt::join(options.missing, ", ")));
  check(options, a.output);
  Progress progress(std::nullopt, "");
  const ExportedPlan e = open_map(a).export_plan(a.output, options, on(progress));
  progress.clear();
  if (!a.json) return print(e, options);
  auto storeys = nlohmann::json::array();
  for (const ExportedStorey& s : e.storeys) storeys.push_back(in_json(s, options.coverage));
  nlohmann::json told{{"scale", e.scale},         {"paper", e.paper},   {"width_mm", e.width_mm},
                      {"height_mm", e.height_mm}, {"storeys", storeys}, {"files", sizes_of(e.files)}};
  if (holds_plan(a.map)) told["missing_recordings"] = options.missing;
  if (options.loops) told["loops"] = {{"drawn", e.loops}, {"between_recordings", e.loops_between}};
  fmt::print("{}\n", text_of(told, 2));
}

std::uintmax_t size_below(const fs::path& folder) {
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) bytes += entry.file_size();
  return bytes;
}

void export_views(const Arguments& a) {
  ViewsOptions options{.program = *a.program, .images = a.images};
  if (a.options.point_spacing > 0) options.point_spacing = a.options.point_spacing;
  Progress progress(std::nullopt, "");
  const ExportedViews e = open_map(a).export_views(a.output, options, on(progress));
  progress.clear();
  if (a.json)
    fmt::print("{}\n", text_of({{"images", e.images}, {"keyframes", e.keyframes}, {"points", e.points}}, 2));
  else
    say("{}  {}, {} images of {} keyframes, {} points\n", a.output.string(), size_in_words(size_below(a.output)),
        e.images, e.keyframes, count_in_words(e.points));
}

/// Prints sizes of the files written beside the requested file.
void print_others(const std::vector<fs::path>& files) {
  constexpr std::size_t kMostLines = 8;
  if (files.size() > kMostLines + 1) {
    std::uintmax_t bytes = 0;
    for (std::size_t i = 1; i < files.size(); ++i) bytes += fs::file_size(files[i]);
    say("{}  {} in {} files\n", (files.back().parent_path() / "").string(), size_in_words(bytes), files.size() - 1);
    return;
  }
  for (std::size_t i = 1; i < files.size(); ++i)
    say("{}  {}\n", files[i].string(), size_in_words(fs::file_size(files[i])));
}

void print(const Arguments& a, const Exported& e) {
  double seconds = 0;
  for (const auto& [stage, ms] : e.stage_ms) seconds += 1e-3 * ms;
  const std::string head = fmt::format("{}  {}", a.output.string(), size_in_words(fs::file_size(a.output)));
  if (e.points > 0)
    say("{}, {} points in {:.1f} s\n", head, count_in_words(e.points), seconds);
  else
    say("{}, {} triangles{}{} in {:.1f} s\n", head, count_in_words(e.triangles),
        e.triangles < e.full_triangles ? " of " + count_in_words(e.full_triangles) : "",
        e.tiles > 0            ? fmt::format(" in {} tiles", e.tiles)
        : a.options.levels > 1 ? ", levels of detail"
                               : "",
        seconds);
  print_others(e.files);
  if (e.components_removed + e.holes_filled > 0)
    say("clean     {} floating pieces removed, {} holes filled\n", e.components_removed, e.holes_filled);
  if (e.error > 0) say("simplify  {:.1f} mm at most\n", 1e3 * static_cast<double>(e.error));
  if (e.textures > 0)
    say("texture   {} texels of {:.1f} mm in {} charts, {:.1f} % of them seen by {} keyframes\n",
        count_in_words(e.texels), 1e3 * static_cast<double>(e.texel),
        count_in_words(static_cast<std::uint64_t>(e.charts)), 100 * e.textured_share, e.keyframes);
}

/// Checks the output and the files beside it against the inputs.
void expect_apart(const Arguments& a) {
  const Inputs inputs = Inputs().add_map(a.map);
  if (a.program) return inputs.expect_apart_from_folder(a.output);
  const auto beside = [&](const char* extension) { return fs::path(a.output).replace_extension(extension); };
  inputs.expect_apart_from_file(a.output);
  const std::string extension = extension_of(a.output);
  if (extension == ".json") inputs.expect_apart_from_folder(beside(".tiles"));
  if (extension == ".gltf") inputs.expect_apart_from_file(beside(".bin"));
  if (extension == ".obj") inputs.expect_apart_from_file(beside(".mtl"));
}

void run_export(const Arguments& a) {
  if (a.asks_for_plan && (a.program || !is_plan(a.output)))
    throw CLI::ValidationError("--output", a.output.string() +
                                               ": --scale, --height, --path, --loops, --coverage and --title "
                                               "are for floor plans, X.svg and X.pdf");
  expect_apart(a);
  if (const fs::path folder = a.output.parent_path(); !folder.empty()) prepare_output(folder);
  want_folder(a);
  if (a.program) return export_views(a);
  if (extension_of(a.output) == ".vdb") return export_grids(a);
  if (is_plan(a.output)) return export_plan(a);
  const Exported e = export_it(a);
  if (a.json) {
    nlohmann::json told = to_json(e);
    told["files"] = sizes_of(e.files);
    fmt::print("{}\n", text_of(told, 2));
    return;
  }
  print(a, e);
}

}  // namespace

ExportOptions MeshArguments::for_file(const fs::path& file) const {
  ExportOptions options = *this;
  const std::string extension = extension_of(file);
  const bool may_have_texture = extension != ".ply" && extension != ".stl" && point_spacing <= 0;
  options.texture.enabled = asks_for_texture || (may_have_texture && !no_texture);
  return options;
}

Exported with_texture_if_any(const MeshArguments& arguments, const fs::path& file,
                             const std::function<Exported(const ExportOptions&)>& write) {
  ExportOptions options = arguments.for_file(file);
  try {
    return write(options);
  } catch (const NoTexture&) {
    if (arguments.asks_for_texture) throw;
    options.texture.enabled = false;
    return write(options);
  }
}

Exported export_mesh(Map map, const fs::path& file, const MeshArguments& arguments, const ExportProgress& progress) {
  return with_texture_if_any(arguments, file,
                             [&](const ExportOptions& options) { return map.export_mesh(file, options, progress); });
}

void add_up(CLI::App& command, std::optional<Up>& up) {
  command
      .add_option_function<std::string>(
          "--up", [&up](const std::string& name) { up = up_of(name); },
          "What points up, where the map does not stand upright: auto, camera, or an axis of the given poses or of the "
          "first camera: x, y, z, -x, -y, -z; all is turned so, as by reconstruct --up")
      ->check(CLI::IsMember({"auto", "camera", "x", "y", "z", "-x", "-y", "-z"}));
}

void add_export_options(CLI::App& command, MeshArguments& o) {
  constexpr const char* kGroup = "Mesh";
  const auto option = [&](const char* name, auto& value, const char* field, Unit unit, const char* help) {
    return add_number(command, name, value, export_range_of(field), unit, help)->capture_default_str()->group(kGroup);
  };
  auto* ratio = option("--simplify", o.simplify.ratio, "SimplifyOptions::ratio", Unit::share,
                       "Share of the triangles that is left");
  auto* max_error = option("--max-error", o.simplify.max_error, "SimplifyOptions::max_error", Unit::metres,
                           "How far simplification may move the surface; 0: what --simplify needs, two voxels at most");
  add_number(command, "--triangles", o.simplify.triangles, export_range_of("SimplifyOptions::triangles"),
             "No more triangles than that are left, however far the surface moves for it [all]")
      ->excludes(ratio)
      ->excludes(max_error)
      ->group(kGroup);
  option("--min-piece", o.clean.min_piece, "CleanOptions::min_piece", Unit::metres,
         "Smaller floating pieces are removed");
  option("--min-weight", o.clean.min_weight, "CleanOptions::min_weight", Unit::none,
         "Observations at 1 m; surface that was seen less is removed");
  option("--fill-holes", o.clean.fill_holes, "CleanOptions::fill_holes", Unit::metres, "Smaller holes are closed");
  auto* none = command.add_flag("--no-texture", o.no_texture,
                                "The voxels' colours instead of a texture from the keyframes [texture where there is "
                                "colour]");
  none->group(kGroup);
  const auto of_texture = [&](CLI::Option* one) {
    one->excludes(none)->each([&o](const std::string&) { o.asks_for_texture = true; });
  };
  auto* texture = command.add_flag("--texture", o.asks_for_texture, "A texture, or an error where there can be none");
  texture->excludes(none)->group(kGroup);
  of_texture(option("--texel", o.texture.texel, "TextureOptions::texel", Unit::metres,
                    "Side of a texel; 0: what the keyframes see, as far as it fits"));
  of_texture(option("--texture-size", o.texture.max_size, "TextureOptions::max_size", Unit::pixels,
                    "Texels a side of one texture, at most"));
  of_texture(command.add_option("--texture-format", o.texture.png, "jpeg or png [jpeg]")
                 ->transform(one_of<bool>({{"jpeg", false}, {"png", true}}))
                 ->group(kGroup));
  of_texture(option("--jpeg-quality", o.texture.jpeg_quality, "TextureOptions::jpeg_quality", Unit::none,
                    "Of textures; more is larger"));
  command
      .add_option("--compress", o.compression,
                  "glTF: none, quantised (KHR_mesh_quantization), meshopt (EXT_meshopt_compression) or draco "
                  "(KHR_draco_mesh_compression) [none]")
      ->transform(one_of<Compression>({{"none", Compression::none},
                                       {"quantised", Compression::quantised},
                                       {"meshopt", Compression::meshopt},
                                       {"draco", Compression::draco}}))
      ->group(kGroup);
  option("--cell-size", o.cell_size, "ExportOptions::cell_size", Unit::metres,
         "glTF gets a node, 3D Tiles a tile for each cell; 0: by the map's size");
  command
      .add_flag(
          "--lit", o.lit,
          "glTF: shaded by the viewer's lamps, for programs that show KHR_materials_unlit white (VTK 9.1, f3d 1.3)")
      ->group(kGroup);
  command.add_flag("--cameras", o.cameras, "glTF: the camera's path as a line, and a camera for each keyframe")
      ->group(kGroup);
}

namespace {

void add_plan_options(CLI::App& command, const std::shared_ptr<Arguments>& a) {
  constexpr const char* kGroup = "Floor plan";
  const auto of_plan = [&](CLI::Option* one) {
    one->group(kGroup)->each([a](const std::string&) { a->asks_for_plan = true; });
  };
  of_plan(command
              .add_option_function<std::string>(
                  "--scale", [a](const std::string& text) { a->plan.scale = parse_scale(text); },
                  "N of 1:N, on the smallest paper from A4 to A0 that it fits on, or a larger one [50 where that fits "
                  "on A3, else 100, 200 or 500 where that fits on A0]")
              ->type_name("SCALE"));
  of_plan(add_number(command, "--height", a->plan.height, export_range_of("PlanOptions::height"), Unit::metres,
                     "Above each floor, where walls are cut")
              ->capture_default_str());
  of_plan(command.add_flag("--path", a->plan.path, "The camera's path, too; of each recording in a colour"));
  of_plan(command.add_flag("--loops", a->plan.loops, "Lines between places that were recognised as the same, too"));
  of_plan(command.add_flag("--coverage", a->plan.coverage,
                           "Marks where nobody looked within the building's outline, and tells how much that is"));
  of_plan(command.add_option("--title", a->plan.title, "What the plan names as what it shows [the map's folder]"));
}

}  // namespace

void add_export(CLI::App& program) {
  auto* command =
      program.add_subcommand("export", "Write a map's mesh, clean, simplified, textured, packed, or a floor plan");
  const auto a = std::make_shared<Arguments>();
  command->add_option("MAP", a->map, "Folder that reconstruct, live or merge has made, or its map.vdb")
      ->required()
      ->check(CLI::ExistingPath);
  command
      ->add_option("-o,--output", a->output,
                   "X.glb, X.gltf, X.ply, X.obj, X.stl: for printing, metres, z up, tileset.json: 3D Tiles 1.1 with "
                   "levels of detail, X.vdb: the grids, X.pdf, X.svg: a floor plan to scale, with "
                   "a page, or X-1.svg, X-2.svg, for each storey, or with --for a new folder")
      ->required()
      ->type_name(kPath);
  add_export_options(*command, a->options);
  add_number(*command, "--points", a->options.point_spacing,
             {.least = 0, .most = export_range_of("ExportOptions::point_spacing").most, .is_open = true}, Unit::metres,
             "X.ply: points that far apart, no triangles; with --for those that the program begins from [0.02]")
      ->group("Mesh");
  add_number(*command, "--lods", a->options.levels, export_range_of("ExportOptions::levels"),
             "Levels of detail, each with a quarter of the triangles: X.glb, X.lod1.glb, ...")
      ->capture_default_str()
      ->group("Mesh");
  command
      ->add_option(
          "--frame", a->options.axes,
          "world (x right, y down, z forward), yup or zup, whatever the format is [glTF and OBJ yup, STL and 3D "
          "Tiles zup, PLY and VDB world]")
      ->transform(one_of<Axes>({{"world", Axes::world}, {"yup", Axes::y_up}, {"zup", Axes::z_up}}))
      ->group("Mesh");
  add_up(*command, a->up);
  command
      ->add_option_function<std::string>(
          "--geo", [a](const std::string& text) { a->options.geo = parse_geo(text); },
          "LAT,LON,HEIGHT,HEADING: where on the Earth a tileset's origin is (WGS 84, degrees, metres), and where the "
          "map's z points, in degrees clockwise from north")
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
             "With --for: so many at most, the sharpest of their surroundings; 0: all")
      ->needs(program_name)
      ->capture_default_str()
      ->group("Images");
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { run_export(*a); });
}

}  // namespace cairn::apps
