// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cairn/mapping/pose_graph.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/json_text.hpp"

namespace cairn::apps {
namespace {

struct Arguments {
  std::filesystem::path input, output;
  OptimizeOptions options{.robust = false};
  bool json = false;
};

void optimize_file(const Arguments& a) {
  Inputs().add(a.input).check_output_file(a.output);
  PoseGraph graph = read_g2o(a.input);
  const double chordal_before = chordal_cost(graph);
  const OptimizeReport r = optimize(graph, a.options);
  if (!a.output.empty()) write_g2o(a.output, graph);
  const auto rejected = std::count_if(r.edge_weights.begin(), r.edge_weights.end(), [](double w) { return w < 0.5; });
  if (a.json) {
    fmt::print("{}\n", format_json({{"nodes", graph.world_from_node.size()},
                                    {"edges", graph.edges.size()},
                                    {"components", r.components},
                                    {"cost_before", r.cost_before},
                                    {"cost", r.cost},
                                    {"chordal_cost_before", chordal_before},
                                    {"chordal_cost", chordal_cost(graph)},
                                    {"started_from_chordal", r.from_chordal},
                                    {"iterations", r.iterations},
                                    {"rejected_edges", rejected},
                                    {"seconds", r.seconds}},
                                   2));
    return;
  }
  fmt::print("{} nodes, {} edges, {} {}\n", graph.world_from_node.size(), graph.edges.size(), r.components,
             r.components == 1 ? "component" : "components, each fixed at its first node");
  fmt::print("cost     {:.6g} -> {:.6g} in {} iterations, {:.2f} s, from the {}\n", r.cost_before, r.cost, r.iterations,
             r.seconds, r.from_chordal ? "chordal initialization" : "given poses");
  fmt::print("chordal  {:.6g} -> {:.6g}\n", chordal_before, chordal_cost(graph));
  if (a.options.robust) fmt::print("{} edges rejected\n", rejected);
}

}  // namespace

void add_graph(CLI::App& program) {
  auto* graph = program.add_subcommand("graph", "Tools for pose graphs");
  graph->require_subcommand(1);
  auto* command = graph->add_subcommand("optimize", "Optimize the poses of a .g2o file");
  const auto a = std::make_shared<Arguments>();
  command->add_option("GRAPH", a->input, "A .g2o file of VERTEX_SE3:QUAT and EDGE_SE3:QUAT")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("-o,--output", a->output, "File for the optimized graph [none]")->type_name(kFile);
  command->add_flag("--robust", a->options.robust, "Detect and reject false edges between non-consecutive nodes");
  command->add_flag("--json", a->json, "Print the result to stdout as JSON");
  command->callback([a] { optimize_file(*a); });
}

}  // namespace cairn::apps
