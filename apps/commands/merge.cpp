// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/building/merge.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "base/unfinished.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/output_folder.hpp"
#include "cli/outputs.hpp"
#include "cli/quantity.hpp"
#include "cli/run.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments : OutputArguments {
  std::vector<fs::path> maps;
  int device = -1;
  bool allow_disconnected = false;
  MeshArguments mesh;
};

/// The rig of stored keyframes, which are corrected for the readout.
Rig without_readout(Rig rig) {
  rig.depth.readout = 0;
  if (rig.color) rig.color->camera.readout = 0;
  return rig;
}

void merge(Arguments a) {
  check(a.mesh.for_file("mesh.glb"), "mesh.glb");
  Inputs inputs;
  for (const fs::path& map : a.maps) inputs.add_map(map);
  inputs.check_output_folder(a.output);
  const Session::Info first = Session::info(a.maps[0] / "session");
  for (const fs::path& map : a.maps) {
    const Session::Info info = Session::info(map / "session");
    if (!without_readout(info.rig).has_same_cameras(without_readout(first.rig)))
      throw std::runtime_error(map.string() + ": has another camera than " + a.maps[0].string() +
                               "; only maps of the same camera can be merged");
    if (info.voxel_size != first.voxel_size || info.truncation != first.truncation)
      throw std::runtime_error(fmt::format("{}: has voxels of {} m, {} of {} m; map both with the same --voxel-size",
                                           map.string(), info.voxel_size, a.maps[0].string(), first.voxel_size));
  }
  a.output = choose_output(a, false);
  inputs.check_output_folder(a.output);
  std::optional<Unfinished> unfinished;  // existing files are kept
  if (!fs::exists(a.output)) unfinished.emplace(a.output);
  prepare_output(a.output);
  std::vector<fs::path> sessions;
  for (const fs::path& map : a.maps) sessions.push_back(map / "session");
  const auto merged = merge_sessions(sessions, a.output / "session", a.allow_disconnected, a.device);
  for (std::size_t i = 1; i < merged.size(); ++i)
    print_result("{}: {} of {} keyframes match the other maps{}\n", a.maps[i].string(), merged[i].loops,
                 merged[i].compared, merged[i].merged ? "" : "; kept as a separate component");
  Session session = Session::resume(a.output / "session");
  Mapper mapper = session.mapper(a.device);
  Outputs outputs(a.output, [](const char*, const auto& work) { work(); });
  nlohmann::json report = outputs.write(mapper, &session, a.mesh, RunProgress{}.note());
  std::size_t poses = 0;
  for (int i = 0; i < mapper.recordings(); ++i) poses += mapper.trajectory(i).size();
  std::vector<std::string> maps;
  for (const fs::path& map : a.maps) maps.push_back(map.string());
  std::vector<std::string> warnings = outputs.warnings();
  // More than one component is a valid result of merge.
  if (const int components = report["submaps"]["components"]; components > 1)
    warnings.push_back(fmt::format("the map has {} unconnected components; the largest is written", components));
  const int frames = static_cast<int>(poses);
  const Verdict verdict =
      RunMonitor(Rig{}, Options{}).verdict({.total = frames, .fused = frames, .components = 1, .warnings = warnings});
  report.update({{"sequence", fmt::format("{}", fmt::join(maps, " + "))},
                 {"options", {{"voxel_size", first.voxel_size}, {"truncation", first.truncation}}},
                 {"frames", {{"total", poses}, {"fused", poses}, {"lost", 0}, {"skipped", 0}}},
                 {"peak_memory_mb", peak_memory_mb()},
                 {"verdict", to_json(verdict)},
                 {"warnings", warnings}});
  outputs.write_report(report);
  if (a.overwrite) outputs.remove_old(mapper, true);
  outputs.expect_all();
  print_result("mesh        {} ({} triangles)\n", (a.output / "mesh.glb").string(),
               format_count(report["mesh"]["triangles"].get<std::size_t>()));
  if (!is_quiet()) print_upright(report["upright"]);
  for (const std::string& warning : warnings) print_result("warning     {}\n", warning);
}

}  // namespace

void add_merge(CLI::App& program) {
  auto* command = program.add_subcommand("merge", "Merge maps of the same place by the same camera");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option(
          "MAPS", a->maps,
          "Two or more folders written by reconstruct, live or merge, with their sessions; they are not changed")
      ->required()
      ->expected(2, 1000)
      ->check(CLI::ExistingDirectory);
  add_output_options(*command, *a, "-o,--output", "Folder for the merged map and its session");
  command->add_flag("--allow-disconnected", a->allow_disconnected,
                    "Keep a map without loop closures to the others as a separate component, instead of an error");
  add_export_options(*command, a->mesh);
  add_device(*command, a->device);
  command->callback([a] { merge(*a); });
}

}  // namespace cairn::apps
