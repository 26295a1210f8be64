// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <numbers>

#include "cairn/evaluation.hpp"
#include "cairn/source.hpp"
#include "commands.hpp"

namespace cairn::apps {
namespace {

struct Arguments {
  std::string estimate, truth, seen;
  double rpe_interval = 1.0, max_time_difference = 0.02;
  int frames = 0, samples = 200000;
  bool json = false;
};

nlohmann::json to_json(const ErrorStatistics& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"max", s.max}, {"count", s.count}};
}

void print_row(const std::string& name, const ErrorStatistics& s, double scale, const char* unit) {
  fmt::print("{:<22}{:>10.3f}{:>10.3f}{:>10.3f}{:>10.3f}  {}\n", name, scale * s.rmse, scale * s.mean, scale * s.median,
             scale * s.max, unit);
}
void print_head() { fmt::print("{:<22}{:>10}{:>10}{:>10}{:>10}\n", "", "rmse", "mean", "median", "max"); }

void evaluate_trajectory_files(const Arguments& a) {
  // A recording's folder stands for the true poses in it.
  const Trajectory truth = std::filesystem::is_directory(a.truth) ? recorded_truth(a.truth) : read_trajectory(a.truth);
  const auto e = evaluate_trajectory(read_trajectory(a.estimate), truth, a.rpe_interval, a.max_time_difference);
  if (a.json) {
    nlohmann::json j{{"ate_m", to_json(e.ate)},
                     {"rpe_translation_m", to_json(e.rpe_translation)},
                     {"rpe_rotation_rad", to_json(e.rpe_rotation)},
                     {"rpe_interval_s", e.rpe_interval},
                     {"estimated_poses", e.estimated_poses},
                     {"matched_poses", e.matched_poses}};
    if (a.frames > 0) j["frames"] = a.frames;
    fmt::print("{}\n", j.dump(2));
    return;
  }
  print_head();
  print_row("ATE", e.ate, 100, "cm");
  print_row(fmt::format("RPE over {} s", e.rpe_interval), e.rpe_translation, 100, "cm");
  print_row("", e.rpe_rotation, 180 / std::numbers::pi, "degrees");
  fmt::print(
      "poses                 {}{}, {} with a true pose\n", e.estimated_poses,
      a.frames > 0 ? fmt::format(" for {} frames ({:.1f} %)", a.frames, 100.0 * e.estimated_poses / a.frames) : "",
      e.matched_poses);
}

void evaluate_mesh_files(const Arguments& a) {
  const Mesh seen = a.seen.empty() ? Mesh{} : read_mesh(a.seen);
  const auto e = evaluate_mesh(read_mesh(a.estimate), read_mesh(a.truth), a.samples, a.seen.empty() ? nullptr : &seen);
  if (a.json) {
    nlohmann::json j{{"accuracy_m", to_json(e.accuracy)}, {"completeness_m", to_json(e.completeness)}};
    for (const auto& at : e.at)
      j["at"].push_back(
          {{"threshold_m", at.threshold}, {"precision", at.precision}, {"recall", at.recall}, {"f_score", at.f_score}});
    fmt::print("{}\n", j.dump(2));
    return;
  }
  print_head();
  print_row("accuracy", e.accuracy, 1000, "mm");
  print_row("completeness", e.completeness, 1000, "mm");
  for (const auto& at : e.at)
    fmt::print("within {:.0f} cm           {:.2f} % of the estimate, {:.2f} % of the truth, F-score {:.2f} %\n",
               100 * at.threshold, 100 * at.precision, 100 * at.recall, 100 * at.f_score);
}

}  // namespace

void add_evaluate(CLI::App& program) {
  auto* command = program.add_subcommand("evaluate", "Compare a trajectory or a mesh with the truth");
  command->require_subcommand(1);
  const auto a = std::make_shared<Arguments>();

  auto* trajectory = command->add_subcommand("trajectory", "ATE and RPE as the TUM benchmark defines them");
  trajectory->add_option("ESTIMATE", a->estimate, "TUM trajectory file")->required()->check(CLI::ExistingFile);
  trajectory->add_option("TRUTH", a->truth, "TUM trajectory file, or the folder of a recording with true poses")
      ->required()
      ->check(CLI::ExistingPath);
  trajectory->add_option("--rpe-interval", a->rpe_interval, "Seconds")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  trajectory->add_option("--max-time-difference", a->max_time_difference, "Seconds between matched poses")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  trajectory->add_option("--frames", a->frames, "Frames of the sequence, to tell how many have a pose");
  trajectory->add_flag("--json", a->json, "Print JSON, in metres and radians");
  trajectory->callback([a] { evaluate_trajectory_files(*a); });

  auto* mesh = command->add_subcommand("mesh", "Accuracy, completeness and F-score");
  mesh->add_option("ESTIMATE", a->estimate, "Mesh (.glb, .gltf, .ply)")->required()->check(CLI::ExistingFile);
  mesh->add_option("TRUTH", a->truth, "Mesh in the same frame")->required()->check(CLI::ExistingFile);
  mesh->add_option("--seen", a->seen, "The part of the truth that completeness is measured on [all of it]")
      ->check(CLI::ExistingFile);
  mesh->add_option("--samples", a->samples, "Points on each surface")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  mesh->add_flag("--json", a->json, "Print JSON, in metres");
  mesh->callback([a] { evaluate_mesh_files(*a); });
}

}  // namespace cairn::apps
