// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/atomic_file.hpp"
#include "cairn/building/project.hpp"
#include "cairn/mapping/map.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/exit_codes.hpp"
#include "cli/json_text.hpp"
#include "cli/output_folder.hpp"
#include "cli/outputs.hpp"
#include "cli/plan_info.hpp"
#include "cli/run.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path plan;
  bool json = false;
};

nlohmann::json to_json(const MergedSegment& segment) {
  nlohmann::json json{{"name", segment.name},     {"recording", segment.recording},
                      {"frames", segment.frames}, {"keyframes", segment.keyframes},
                      {"moved_m", segment.moved}, {"joined", segment.left_out.empty()}};
  if (!segment.left_out.empty()) json["left_out"] = segment.left_out;
  return json;
}

/// Ends with exit code 3 if a segment is missing in the map.
void exit_unless_complete(const Verdict& verdict) {
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
  write_whole(a.plan / "report.json", format_json(report, 1) + '\n');
}

void optimize_plan(const Arguments& a) {
  const OptimizedProject o = optimize_project(a.plan);
  nlohmann::json report{{"plan", a.plan.string()},
                        {"loops", {{"found", o.loops}, {"believed", o.inliers}, {"overlapping_frames", o.overlaps}}},
                        {"pairs", {{"near", o.pairs}, {"aligned", o.aligned}}},
                        {"keyframes", o.keyframes},
                        {"submaps", o.submaps},
                        {"cells", {{"count", o.cells}, {"changed", o.changed_cells}}},
                        {"graph", {{"cost_before", o.cost_before}, {"cost", o.cost}}},
                        {"parts", nlohmann::json::array()}};
  int joined = 0;
  for (const MergedSegment& segment : o.segments) {
    report["parts"].push_back(to_json(segment));
    joined += segment.left_out.empty();
  }
  const Verdict verdict = verdict_of(read_plan(a.plan), o.segments);
  report["verdict"] = apps::to_json(verdict);
  write_files(a, report);
  report["graph"]["seconds"] = o.seconds;  // added after the files, since times differ between runs
  if (a.json) {
    fmt::print("{}\n", format_json(report, 2));
    if (verdict.level != Verdict::Level::good) print(verdict, stderr);
    return exit_unless_complete(verdict);
  }
  print_result("{} of {} segments merged by {} of {} loops and {} shared frames\n", joined, o.segments.size(),
               o.inliers, o.loops, o.overlaps);
  if (o.pairs > 0) print_result("{} of {} pairs of nearby keyframes aligned\n", o.aligned, o.pairs);
  print_result("{} keyframes, {} submaps, {} cells, {} of them to build\n", o.keyframes, o.submaps, o.cells,
               o.changed_cells);
  print_result("trajectory  {}\n", (a.plan / "trajectory.txt").string());
  print_result("next: {}\n", next_project_command(a.plan));
  print(verdict, is_quiet() ? stderr : stdout);
  exit_unless_complete(verdict);
}

}  // namespace

void add_optimize(CLI::App& program) {
  auto* command = program.add_subcommand("optimize", "Align and merge the maps of a project's segments");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option("PLAN", a->plan,
                   "Folder of a project, with maps/ of its segments and loops/ between them; receives the merged "
                   "session, trajectory.txt, graph.g2o, report.json and cells/")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_flag("--json", a->json, "Print the result to stdout as JSON");
  command->callback([a] { optimize_plan(*a); });
}

}  // namespace cairn::apps
