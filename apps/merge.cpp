// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "cairn/unfinished.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "inputs_and_outputs.hpp"
#include "output_folder.hpp"
#include "outputs.hpp"
#include "quantity.hpp"
#include "run.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments : OutputArguments {
  std::vector<fs::path> maps;
  int device = -1;
  bool allow_disconnected = false;
  MeshArguments mesh;
};

void merge(Arguments a) {
  check(a.mesh.for_file("mesh.glb"), "mesh.glb");
  Inputs inputs;
  for (const fs::path& map : a.maps) inputs.add_map(map);
  inputs.expect_apart_from_folder(a.output);
  const Session::Info first = Session::info(a.maps[0] / "session");
  for (const fs::path& map : a.maps) {
    const Session::Info info = Session::info(map / "session");
    if (!info.rig.has_same_cameras(first.rig))
      throw std::runtime_error(map.string() + ": was made with another camera than " + a.maps[0].string() +
                               "; such maps cannot be merged");
    if (info.voxel_size != first.voxel_size || info.truncation != first.truncation)
      throw std::runtime_error(fmt::format("{}: has voxels of {} m, {} of {} m; make both with the same --voxel-size",
                                           map.string(), info.voxel_size, a.maps[0].string(), first.voxel_size));
  }
  a.output = choose_output(a, false);
  inputs.expect_apart_from_folder(a.output);
  std::optional<Unfinished> unfinished;  // existing files are kept
  if (!fs::exists(a.output)) unfinished.emplace(a.output);
  prepare_output(a.output);
  std::vector<fs::path> sessions;
  for (const fs::path& map : a.maps) sessions.push_back(map / "session");
  const auto merged = Session::join(sessions, a.output / "session", a.allow_disconnected, a.device);
  for (std::size_t i = 1; i < merged.size(); ++i)
    say("{}: {} of {} keyframes see a place of the others{}\n", a.maps[i].string(), merged[i].loops, merged[i].compared,
        merged[i].joined ? "" : "; kept as a separate piece");
  Session session = Session::resume(a.output / "session");
  Mapper mapper = session.mapper(a.device);
  Outputs outputs(a.output, [](const char*, const auto& work) { work(); });
  nlohmann::json report = outputs.write(mapper, &session, a.mesh, Progressed{}.note());
  std::size_t poses = 0;
  for (int i = 0; i < mapper.recordings(); ++i) poses += mapper.trajectory(i).size();
  std::vector<std::string> maps;
  for (const fs::path& map : a.maps) maps.push_back(map.string());
  std::vector<std::string> warnings = outputs.warnings();
  // More than one component is a valid result of merge.
  if (const int pieces = report["submaps"]["components"]; pieces > 1)
    warnings.push_back(fmt::format("{} pieces of the map are not joined; the largest is written", pieces));
  const int frames = static_cast<int>(poses);
  const Verdict verdict =
      Evidence(Rig{}, Options{}).verdict({.total = frames, .fused = frames, .components = 1, .warnings = warnings});
  report.update({{"sequence", fmt::format("{}", fmt::join(maps, " + "))},
                 {"options", {{"voxel_size", first.voxel_size}, {"truncation", first.truncation}}},
                 {"frames", {{"total", poses}, {"fused", poses}, {"lost", 0}, {"skipped", 0}}},
                 {"peak_memory_mb", peak_memory_mb()},
                 {"verdict", to_json(verdict)},
                 {"warnings", warnings}});
  outputs.write_report(report);
  if (a.overwrite) outputs.remove_old(mapper, true);
  outputs.expect_all();
  say("mesh        {} ({} triangles)\n", (a.output / "mesh.glb").string(),
      count_in_words(report["mesh"]["triangles"].get<std::size_t>()));
  if (!is_quiet()) print_upright(report["upright"]);
  for (const std::string& warning : warnings) say("warning     {}\n", warning);
}

}  // namespace

void add_merge(CLI::App& program) {
  auto* command = program.add_subcommand("merge", "Join maps of the same place, made by the same camera, into one");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option(
          "MAPS", a->maps,
          "Two or more folders that reconstruct, live or merge have made, with their sessions; they stay as they are")
      ->required()
      ->expected(2, 1000)
      ->check(CLI::ExistingDirectory);
  add_output_options(*command, *a, "-o,--output", "Folder for the joined map and its session");
  command->add_flag("--allow-disconnected", a->allow_disconnected,
                    "Keep a map that sees no place of the others as a separate piece, instead of refusing it");
  add_export_options(*command, a->mesh);
  add_device(*command, a->device);
  command->callback([a] { merge(*a); });
}

}  // namespace cairn::apps
