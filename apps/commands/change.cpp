// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/building/change.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/json_text.hpp"
#include "cli/output_folder.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"
#include "cli/recording_names.hpp"
#include "options/option_ranges.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path before, after, output;
  std::string since;
  ChangeOptions options;
  int device = -1;
  bool json = false;
};

ExportedChange change_since(const Arguments& a, const ExportProgress& progress) {
  if (!fs::exists(a.before / "plan.json"))
    throw std::runtime_error(a.before.string() +
                             ": is not a project, so it does not separate its recordings: --since needs a folder of "
                             "cairn plan; for two maps, name both");
  const std::vector<std::string> names = recordings_in(a.before);
  std::size_t since = 0;
  try {
    since = find_recording(a.since, names);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(a.before.string() + ": " + error.what());
  }
  return export_change_since(a.before, since, a.output, a.options, progress, a.device);
}

nlohmann::json to_json(const ChangedRegion& region) {
  const auto list = [](const Eigen::Vector3d& v) { return nlohmann::json{v.x(), v.y(), v.z()}; };
  return {{"kind", region.is_new ? "new" : "gone"},
          {"area_m2", region.area},
          {"middle_m", list(region.middle)},
          {"extent_m", list(region.extent)}};
}

void print(const Arguments& a, const ExportedChange& e) {
  constexpr std::size_t kMaxLines = 8;
  print_result("{}  {}, {} triangles\n", a.output.string(), format_size(fs::file_size(a.output)),
               format_count(e.triangles));
  const auto count = [&](bool is_new) {
    return std::count_if(e.regions.begin(), e.regions.end(), [&](const auto& p) { return p.is_new == is_new; });
  };
  print_result("new     {:.2f} m2 in {} components (blue)\n", e.new_area, count(true));
  print_result("gone    {:.2f} m2 in {} components (orange)\n", e.gone_area, count(false));
  for (std::size_t i = 0; i < std::min(kMaxLines, e.regions.size()); ++i) {
    const ChangedRegion& p = e.regions[i];
    print_result("  {}  {:.2f} m2 at {:.2f} {:.2f} {:.2f}\n", p.is_new ? "new " : "gone", p.area, p.middle.x(),
                 p.middle.y(), p.middle.z());
  }
  if (e.regions.size() > kMaxLines)
    print_result("  and {} smaller ones: --json lists all\n", e.regions.size() - kMaxLines);
  print_result(
      "common  {:.1f} m2 of the later surface are in space observed by the earlier map; distances below {:.0f} mm are "
      "no change\n",
      e.common_area, 1e3 * e.distance);
}

void run_change(const Arguments& a) {
  if (a.after.empty() == a.since.empty())
    throw CLI::ValidationError(
        "change", a.since.empty() ? "needs AFTER, or --since with a project" : "takes AFTER or --since, not both");
  Inputs().add_map(a.before).add_map(a.after).check_output_file(a.output);
  if (const fs::path folder = a.output.parent_path(); !folder.empty()) prepare_output(folder);
  Progress progress(std::nullopt, "");
  const ExportedChange e =
      a.since.empty() ? export_change(a.before, a.after, a.output, a.options, export_progress(progress), a.device)
                      : change_since(a, export_progress(progress));
  progress.clear();
  if (!a.json) return print(a, e);
  auto pieces = nlohmann::json::array();
  for (const ChangedRegion& region : e.regions) pieces.push_back(to_json(region));
  fmt::print("{}\n", format_json({{"new_m2", e.new_area},
                                  {"gone_m2", e.gone_area},
                                  {"both_seen_m2", e.common_area},
                                  {"distance_m", e.distance},
                                  {"pieces", pieces},
                                  {"triangles", e.triangles},
                                  {"file", a.output.string()}},
                                 2));
}

}  // namespace

void add_change(CLI::App& program) {
  auto* command =
      program.add_subcommand("change", "Show the changes between two maps: new and gone surface, in colors");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option("BEFORE", a->before,
                   "Folder of the earlier map, or its map.vdb; with --since, a project after optimize")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("AFTER", a->after, "The later map, in the frame of the earlier one")->check(CLI::ExistingPath);
  command->add_option(
      "--since", a->since,
      "Compare the project's recordings from this one on with those before; a number from 0, or a name");
  command
      ->add_option("-o,--output", a->output,
                   "X.glb, X.gltf: the later surface in gray, new surface in blue, gone surface in orange")
      ->required()
      ->type_name(kFile);
  add_number(*command, "--distance", a->options.distance, export_range_of("ChangeOptions::distance"), Unit::meters,
             "Maximum distance between two scans of an unchanged surface, at most 8 voxels; 0: four voxels")
      ->capture_default_str();
  add_number(*command, "--min-area", a->options.min_area, export_range_of("ChangeOptions::min_area"),
             Unit::square_meters, "Minimum area of a changed component")
      ->capture_default_str();
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print JSON, with the area, center and extent of each component");
  command->callback([a] { run_change(*a); });
}

}  // namespace cairn::apps
