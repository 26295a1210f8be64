// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cairn/parts.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "inputs_and_outputs.hpp"
#include "json_text.hpp"
#include "plan_info.hpp"
#include "quantity.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> recordings;
  fs::path output;
  std::optional<int> frames_per_part, overlap;
  bool json = false;
};

/// Options of the command line; defaults come from the existing plan.
PartsPlan options_of(const Arguments& a) {
  const PartsPlan there = fs::exists(a.output / "plan.json") ? read_plan(a.output) : PartsPlan{};
  return {.frames_per_part = a.frames_per_part.value_or(there.frames_per_part),
          .overlap = a.overlap.value_or(there.overlap)};
}

nlohmann::json to_json(const PartsPlan& plan, const fs::path& folder) {
  auto recordings = nlohmann::json::array(), parts = nlohmann::json::array();
  for (const auto& r : plan.recordings)
    recordings.push_back({{"name", r.name}, {"frames", r.frames}, {"other_camera", r.other_camera}});
  for (const auto& p : plan.parts)
    parts.push_back({{"name", p.name},
                     {"folder", (folder / "parts" / p.name).string()},
                     {"recording", p.recording},
                     {"begin", p.begin},
                     {"end", p.end}});
  return {{"plan", folder.string()}, {"recordings", recordings}, {"parts", parts}};
}

void print(const PartsPlan& plan, const fs::path& folder) {
  int most = 0;
  for (std::size_t i = 0; i < plan.recordings.size(); ++i) {
    std::vector<std::string> names;
    for (const auto& part : plan.parts) {
      if (part.recording == i) names.push_back(part.name);
      most = std::max(most, part.end - part.begin);
    }
    say("{}: {} frames, {}{}\n", plan.recordings[i].name,
        count_in_words(static_cast<std::uint64_t>(plan.recordings[i].frames)),
        names.size() == 1 ? "part " + names[0] : fmt::format("parts {} to {}", names.front(), names.back()),
        plan.recordings[i].other_camera ? ", turned into what the first one's camera would have taken" : "");
  }
  say("{}: {} {}, of {} frames at most\n", folder.string(), count_in_words(plan.parts.size()),
      plan.parts.size() == 1 ? "part" : "parts", count_in_words(static_cast<std::uint64_t>(most)));
}

void plan(const Arguments& a) {
  Inputs inputs;
  for (const std::string& recording : a.recordings) inputs.add_recording(recording);
  inputs.expect_apart_from_folder(a.output);
  const PartsPlan plan = plan_parts(a.recordings, a.output, options_of(a));
  if (a.json)
    fmt::print("{}\n", text_of(to_json(plan, a.output), 2));
  else
    print(plan, a.output);
  if (!a.json) say("next: {}\n", next_of_plan(a.output));
}

}  // namespace

void add_plan(CLI::App& program) {
  auto* command = program.add_subcommand("plan", "Cut a building's recordings into parts, each for a run of its own");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option(
          "RECORDING", a->recordings,
          "As reconstruct takes them, the one with the best camera first; those that the plan has stay as they are")
      ->required()
      ->expected(1, 100000)
      ->type_name(kPath);
  command
      ->add_option("-o,--output", a->output,
                   "Folder for the plan, or of one that grows; its parts are FOLDER/parts/000 and so on")
      ->required()
      ->type_name(kFolder);
  add_number(*command, "--frames-per-part", a->frames_per_part, {1, 1e9},
             "So many at most, and the overlap [3000, or the plan's]");
  add_number(*command, "--overlap", a->overlap, {0, 1e9},
             "Frames that a part has in common with the next of its recording [150, or the plan's]");
  command->add_flag("--json", a->json, "Print the plan to stdout as JSON");
  command->callback([a] { plan(*a); });
}

}  // namespace cairn::apps
