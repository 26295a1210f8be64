// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/change.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include "cairn/option_ranges.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "inputs_and_outputs.hpp"
#include "json_text.hpp"
#include "output_folder.hpp"
#include "progress.hpp"
#include "quantity.hpp"
#include "recording_names.hpp"

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
                             ": is no plan, so that its recordings are not kept apart: --since needs a folder of cairn "
                             "plan; of two maps name both");
  const std::vector<std::string> names = recordings_in(a.before);
  std::size_t since = 0;
  try {
    since = recording_named(a.since, names);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(a.before.string() + ": " + error.what());
  }
  return export_change_since(a.before, since, a.output, a.options, progress, a.device);
}

nlohmann::json in_json(const ChangedPiece& piece) {
  const auto list = [](const Eigen::Vector3d& v) { return nlohmann::json{v.x(), v.y(), v.z()}; };
  return {{"kind", piece.is_new ? "new" : "gone"},
          {"area_m2", piece.area},
          {"middle_m", list(piece.middle)},
          {"extent_m", list(piece.extent)}};
}

void print(const Arguments& a, const ExportedChange& e) {
  constexpr std::size_t kMostLines = 8;
  say("{}  {}, {} triangles\n", a.output.string(), size_in_words(fs::file_size(a.output)), count_in_words(e.triangles));
  const auto count = [&](bool is_new) {
    return std::count_if(e.pieces.begin(), e.pieces.end(), [&](const auto& p) { return p.is_new == is_new; });
  };
  say("new     {:.2f} m2 in {} pieces (blue)\n", e.new_area, count(true));
  say("gone    {:.2f} m2 in {} pieces (orange)\n", e.gone_area, count(false));
  for (std::size_t i = 0; i < std::min(kMostLines, e.pieces.size()); ++i) {
    const ChangedPiece& p = e.pieces[i];
    say("  {}  {:.2f} m2 at {:.2f} {:.2f} {:.2f}\n", p.is_new ? "new " : "gone", p.area, p.middle.x(), p.middle.y(),
        p.middle.z());
  }
  if (e.pieces.size() > kMostLines) say("  and {} smaller ones: --json lists all\n", e.pieces.size() - kMostLines);
  say("seen    {:.1f} m2 of the later surface lie where the earlier map knows; nearer than {:.0f} mm is no change\n",
      e.both_seen, 1e3 * e.distance);
}

void run_change(const Arguments& a) {
  if (a.after.empty() == a.since.empty())
    throw CLI::ValidationError("change", a.since.empty() ? "needs AFTER, or --since with a plan"
                                                         : "AFTER and --since: one of them tells what is later");
  Inputs().add_map(a.before).add_map(a.after).expect_apart_from_file(a.output);
  if (const fs::path folder = a.output.parent_path(); !folder.empty()) prepare_output(folder);
  Progress progress(std::nullopt, "");
  const ExportedChange e = a.since.empty()
                               ? export_change(a.before, a.after, a.output, a.options, on(progress), a.device)
                               : change_since(a, on(progress));
  progress.clear();
  if (!a.json) return print(a, e);
  auto pieces = nlohmann::json::array();
  for (const ChangedPiece& piece : e.pieces) pieces.push_back(in_json(piece));
  fmt::print("{}\n", text_of({{"new_m2", e.new_area},
                              {"gone_m2", e.gone_area},
                              {"both_seen_m2", e.both_seen},
                              {"distance_m", e.distance},
                              {"pieces", pieces},
                              {"triangles", e.triangles},
                              {"file", a.output.string()}},
                             2));
}

}  // namespace

void add_change(CLI::App& program) {
  auto* command = program.add_subcommand("change", "What is new and what is gone from one day to another, in colours");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option("BEFORE", a->before,
                   "Folder of the earlier map, or its map.vdb; with --since a plan that optimise has been run on")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("AFTER", a->after, "The later map, in the frame of the earlier one")->check(CLI::ExistingPath);
  command->add_option("--since", a->since,
                      "The plan's recordings from this one on, a number from 0 or a name, against those before");
  command
      ->add_option("-o,--output", a->output,
                   "X.glb, X.gltf: the later surface, grey, with what is new, blue, and what is gone, orange")
      ->required()
      ->type_name(kFile);
  add_number(*command, "--distance", a->options.distance, export_range_of("ChangeOptions::distance"), Unit::metres,
             "How far a surface may be off without having changed, 8 voxels at most; 0: four voxels")
      ->capture_default_str();
  add_number(*command, "--min-area", a->options.min_area, export_range_of("ChangeOptions::min_area"),
             Unit::square_metres, "Smaller pieces have not changed")
      ->capture_default_str();
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print JSON, with each piece's area, middle and extent");
  command->callback([a] { run_change(*a); });
}

}  // namespace cairn::apps
