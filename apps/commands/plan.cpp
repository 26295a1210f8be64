// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cairn/building/project.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/json_text.hpp"
#include "cli/plan_info.hpp"
#include "cli/quantity.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> recordings;
  fs::path output;
  std::optional<int> frames_per_segment, overlap;
  bool json = false;
};

/// Options of the command line; defaults come from the existing plan.
Project options_of(const Arguments& a) {
  const Project existing = fs::exists(a.output / "plan.json") ? read_plan(a.output) : Project{};
  return {.frames_per_segment = a.frames_per_segment.value_or(existing.frames_per_segment),
          .overlap = a.overlap.value_or(existing.overlap)};
}

nlohmann::json to_json(const Project& plan, const fs::path& folder) {
  auto recordings = nlohmann::json::array(), parts = nlohmann::json::array();
  for (const auto& r : plan.recordings)
    recordings.push_back({{"name", r.name}, {"frames", r.frames}, {"other_camera", r.other_camera}});
  for (const auto& p : plan.segments)
    parts.push_back({{"name", p.name},
                     {"folder", (folder / "parts" / p.name).string()},
                     {"recording", p.recording},
                     {"begin", p.begin},
                     {"end", p.end}});
  return {{"plan", folder.string()}, {"recordings", recordings}, {"parts", parts}};
}

void print(const Project& plan, const fs::path& folder) {
  int max_frames = 0;
  for (std::size_t i = 0; i < plan.recordings.size(); ++i) {
    std::vector<std::string> names;
    for (const auto& segment : plan.segments) {
      if (segment.recording == i) names.push_back(segment.name);
      max_frames = std::max(max_frames, segment.end - segment.begin);
    }
    print_result(
        "{}: {} frames, {}{}\n", plan.recordings[i].name,
        format_count(static_cast<std::uint64_t>(plan.recordings[i].frames)),
        names.size() == 1 ? "segment " + names[0] : fmt::format("segments {} to {}", names.front(), names.back()),
        plan.recordings[i].other_camera ? ", reprojected to the camera of the first recording" : "");
  }
  print_result("{}: {} {}, of at most {} frames\n", folder.string(), format_count(plan.segments.size()),
               plan.segments.size() == 1 ? "segment" : "segments",
               format_count(static_cast<std::uint64_t>(max_frames)));
}

void plan(const Arguments& a) {
  Inputs inputs;
  for (const std::string& recording : a.recordings) inputs.add_recording(recording);
  inputs.check_output_folder(a.output);
  const Project plan = plan_project(a.recordings, a.output, options_of(a));
  if (a.json)
    fmt::print("{}\n", format_json(to_json(plan, a.output), 2));
  else
    print(plan, a.output);
  if (!a.json) print_result("next: {}\n", next_project_command(a.output));
}

}  // namespace

void add_plan(CLI::App& program) {
  auto* command = program.add_subcommand("plan", "Divide a building's recordings into segments, each mapped by itself");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option(
          "RECORDING", a->recordings,
          "Recordings as for reconstruct, the one with the best camera first; those already in the project stay")
      ->required()
      ->expected(1, 100000)
      ->type_name(kPath);
  command
      ->add_option("-o,--output", a->output,
                   "Folder of a new or existing project; its segments are FOLDER/parts/000 and so on")
      ->required()
      ->type_name(kFolder);
  add_number(*command, "--frames-per-part", a->frames_per_segment, {1, 1e9},
             "Maximum frames per segment, plus the overlap [3000, or the project's]");
  add_number(*command, "--overlap", a->overlap, {0, 1e9},
             "Frames shared by consecutive segments of a recording [150, or the project's]");
  command->add_flag("--json", a->json, "Print the plan to stdout as JSON");
  command->callback([a] { plan(*a); });
}

}  // namespace cairn::apps
