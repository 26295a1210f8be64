// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <nlohmann/json.hpp>

#include "cairn/mapper.hpp"

namespace cairn::apps {

/// Fails before the work, not after it.
void prepare_output(const std::filesystem::path& output);

/// Calls `work`, and keeps its time under a stage's name.
using Timed = std::function<void(const char* stage, const std::function<void()>& work)>;

/// Writes mesh.glb, map.vdb, the trajectories and, for a tracked map, graph.g2o and graph.svg. Returns what report.json
/// tells about them and the map.
[[nodiscard]] nlohmann::json write_outputs(Mapper& mapper, const std::filesystem::path& output, Poses poses,
                                           const ExportOptions& options, const Timed& timed);

/// What report.json and --json tell of an exported mesh.
[[nodiscard]] nlohmann::json to_json(const Exported& exported);

/// Writes report.json and report.html, which needs the other outputs.
void write_report(const std::filesystem::path& output, const nlohmann::json& report);

}  // namespace cairn::apps
