// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <CLI/CLI.hpp>

// One function and one file per subcommand.
namespace cairn::apps {

void add_reconstruct(CLI::App& program);
void add_export(CLI::App& program);
void add_live(CLI::App& program);
void add_view(CLI::App& program);
void add_record(CLI::App& program);
void add_evaluate(CLI::App& program);
void add_synth(CLI::App& program);
void add_esdf(CLI::App& program);
void add_splat(CLI::App& program);
void add_localize(CLI::App& program);
void add_change(CLI::App& program);
void add_graph(CLI::App& program);
void add_merge(CLI::App& program);
void add_plan(CLI::App& program);
void add_match(CLI::App& program);
void add_optimize(CLI::App& program);
void add_tile(CLI::App& program);
void add_tileset(CLI::App& program);
void add_convert(CLI::App& program);
void add_info(CLI::App& program);
void add_calibrate(CLI::App& program);
void add_bench(CLI::App& program);
void add_devices(CLI::App& program);
void add_demo(CLI::App& program);
void add_doctor(CLI::App& program);
void add_help(CLI::App& program);
void add_completion(CLI::App& program);

}  // namespace cairn::apps
