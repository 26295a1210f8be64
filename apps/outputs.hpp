// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "cairn/mapper.hpp"
#include "cairn/session.hpp"
#include "cairn/verdict.hpp"
#include "export_options.hpp"

namespace cairn::apps {

/// Calls `work`, and keeps its time under a stage's name.
using Timed = std::function<void(const char* stage, const std::function<void()>& work)>;

/// Writes a map's files one after the other. One that fails leaves the others.
class Outputs {
 public:
  /// `stopped`: why the run ended before its recording did, if so. `has_mesh`: with mesh.glb, map.vdb and report.html.
  Outputs(std::filesystem::path output, Timed timed, std::optional<std::string> stopped = {}, bool has_mesh = true)
      : output_(std::move(output)), timed_(std::move(timed)), has_mesh_(has_mesh), why_(std::move(stopped)) {}
  /// Writes the session with `note` and the pose graph as graph.g2o and graph.svg, unless `session` is null, the
  /// trajectories, map.vdb, and mesh.glb last. Returns what report.json tells about them and the map.
  [[nodiscard]] nlohmann::json write(Mapper& mapper, Session* session, const MeshArguments& options,
                                     const std::string& note);
  /// What was written otherwise than it was meant to be, a line each.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }
  /// Writes report.json and report.html, which needs the other outputs.
  void write_report(const nlohmann::json& report);
  /// Removes what the map that was in the folder had and this one has not.
  void remove_old(const Mapper& mapper, bool has_graph) const;
  /// Throws std::runtime_error if the run stopped or anything could not be written: why, and how to make it.
  void expect_all() const;

 private:
  void write_session(Mapper& mapper, Session& session, const std::string& note);
  void write_trajectories(const Mapper& mapper);
  [[nodiscard]] std::optional<Exported> write_mesh(Mapper& mapper, const MeshArguments& options);
  [[nodiscard]] Exported write_model(Mapper& mapper, MeshArguments& options, const ExportProgress& progress);
  void attempt(const char* what, const std::function<void()>& work);
  std::filesystem::path output_;
  Timed timed_;
  bool has_mesh_;
  std::vector<std::string> failed_;  // names of outputs
  std::vector<std::string> warnings_;
  std::optional<std::string> why_;  // it stopped, or the first of them could not be written
};

/// What report.json tells of how well it went.
[[nodiscard]] nlohmann::json to_json(const Verdict& verdict);
/// A line for the user about which way up the map stands, as report.json tells it.
void print_upright(const nlohmann::json& upright);

/// What report.json and --json tell of an exported mesh.
[[nodiscard]] nlohmann::json to_json(const Exported& exported);

}  // namespace cairn::apps
