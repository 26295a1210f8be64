// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "cairn/eval/verdict.hpp"
#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/session.hpp"
#include "cli/export_options.hpp"

namespace cairn::apps {

/// Runs `work` and records its duration under a stage's name.
using Timed = std::function<void(const char* stage, const std::function<void()>& work)>;

/// Writes the files of a map. A failed file does not stop the others.
class Outputs {
 public:
  /// `stopped`: reason if the run ended before its recording. `has_mesh`: writes mesh.glb, map.vdb and report.html.
  Outputs(std::filesystem::path output, Timed timed, std::optional<std::string> stopped = {}, bool has_mesh = true)
      : output_(std::move(output)), timed_(std::move(timed)), has_mesh_(has_mesh), reason_(std::move(stopped)) {}
  /// Writes the session with `note` and the pose graph as graph.g2o and graph.svg (unless `session` is null), the
  /// trajectories, map.vdb, and mesh.glb last. Returns the entries of report.json for these files and the map.
  [[nodiscard]] nlohmann::json write(Mapper& mapper, Session* session, const MeshArguments& options,
                                     const std::string& note);
  /// Warnings about files that deviate from the options, one line each.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }
  /// Writes report.json, and report.html, which embeds the other outputs.
  void write_report(const nlohmann::json& report);
  /// Removes files of the folder's previous map without a successor in this map.
  void remove_old(const Mapper& mapper, bool has_graph) const;
  /// Throws std::runtime_error if the run stopped or a file could not be written, with the reason and a remedy.
  void expect_all() const;

 private:
  void write_session(Mapper& mapper, Session& session, const std::string& note);
  void write_trajectories(const Mapper& mapper);
  [[nodiscard]] std::optional<ExportReport> write_mesh(Mapper& mapper, const MeshArguments& options);
  [[nodiscard]] ExportReport write_model(Mapper& mapper, MeshArguments& options, const ExportProgress& progress);
  void attempt(const char* what, const std::function<void()>& work);
  std::filesystem::path output_;
  Timed timed_;
  bool has_mesh_;
  std::vector<std::string> failed_;  // names of outputs
  std::vector<std::string> warnings_;
  std::optional<std::string> reason_;  // reason of the stop, or of the first failed file
};

/// Verdict for report.json.
[[nodiscard]] nlohmann::json to_json(const Verdict& verdict);
/// Prints the inertial sensors of report.json for the user.
void print_inertial(const nlohmann::json& inertial);
/// Prints the gravity alignment of report.json for the user.
void print_upright(const nlohmann::json& upright);

/// Entry of an exported mesh in report.json and in the --json output.
[[nodiscard]] nlohmann::json to_json(const ExportReport& exported);

}  // namespace cairn::apps
