// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cairn/atomic_file.hpp"
#include "cairn/map.hpp"
#include "cairn/parts.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "exit_codes.hpp"
#include "json_text.hpp"
#include "output_folder.hpp"
#include "outputs.hpp"
#include "plan_info.hpp"
#include "run.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path plan;
  bool json = false;
};

nlohmann::json to_json(const JoinedPart& part) {
  nlohmann::json json{{"name", part.name},           {"recording", part.recording}, {"frames", part.frames},
                      {"keyframes", part.keyframes}, {"moved_m", part.moved},       {"joined", part.left_out.empty()}};
  if (!part.left_out.empty()) json["left_out"] = part.left_out;
  return json;
}

/// Ends with exit code 3 if a part of the plan is missing in its map.
void end_unless_whole(const Verdict& verdict) {
  if (verdict.level != Verdict::Level::good) throw CLI::RuntimeError(kNotInMap);
}

void write_files(const Arguments& a, const nlohmann::json& report) {
  const Map map = Map::open(a.plan);
  for (int i = 0; i < map.recordings(); ++i) {
    const fs::path file = a.plan / name_of_trajectory(i, map.recordings());
    if (const Trajectory t = map.trajectory(i); !t.empty())
      write_trajectory(file, t);
    else
      fs::remove(file);  // left by an earlier merge of this recording
  }
  map.write_graph(a.plan / "graph.g2o");
  map.write_graph(a.plan / "graph.svg");
  write_whole(a.plan / "report.json", text_of(report, 1) + '\n');
}

void optimise_plan(const Arguments& a) {
  const OptimisedParts o = optimise_parts(a.plan);
  nlohmann::json report{{"plan", a.plan.string()},
                        {"loops", {{"found", o.loops}, {"believed", o.believed}, {"overlapping_frames", o.overlaps}}},
                        {"pairs", {{"near", o.pairs}, {"aligned", o.aligned}}},
                        {"keyframes", o.keyframes},
                        {"submaps", o.submaps},
                        {"cells", {{"count", o.cells}, {"changed", o.changed_cells}}},
                        {"graph", {{"cost_before", o.cost_before}, {"cost", o.cost}}},
                        {"parts", nlohmann::json::array()}};
  int joined = 0;
  for (const JoinedPart& part : o.parts) {
    report["parts"].push_back(to_json(part));
    joined += part.left_out.empty();
  }
  const Verdict verdict = verdict_of(read_plan(a.plan), o.parts);
  report["verdict"] = apps::to_json(verdict);
  write_files(a, report);
  report["graph"]["seconds"] = o.seconds;  // added after the files, since times differ between runs
  if (a.json) {
    fmt::print("{}\n", text_of(report, 2));
    if (verdict.level != Verdict::Level::good) print(verdict, stderr);
    return end_unless_whole(verdict);
  }
  say("{} of {} parts joined by {} of {} loops and {} frames that two of them share\n", joined, o.parts.size(),
      o.believed, o.loops, o.overlaps);
  if (o.pairs > 0) say("{} of {} pairs of keyframes that lie near each other agree\n", o.aligned, o.pairs);
  say("{} keyframes, {} submaps, {} cells, {} of them to be made\n", o.keyframes, o.submaps, o.cells, o.changed_cells);
  say("trajectory  {}\n", (a.plan / "trajectory.txt").string());
  say("next: {}\n", next_of_plan(a.plan));
  print(verdict, is_quiet() ? stderr : stdout);
  end_unless_whole(verdict);
}

}  // namespace

void add_optimise(CLI::App& program) {
  auto* command = program.add_subcommand("optimise", "Lay the maps of a plan's parts to each other");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option("PLAN", a->plan,
                   "Folder of a plan, with maps/ of its parts and loops/ between them; it gets the session of all, "
                   "trajectory.txt, graph.g2o, report.json and cells/")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_flag("--json", a->json, "Print the result to stdout as JSON");
  command->callback([a] { optimise_plan(*a); });
}

}  // namespace cairn::apps
