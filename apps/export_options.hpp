// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <CLI/CLI.hpp>

#include "cairn/export.hpp"

namespace cairn::apps {

/// How a mesh is written: what `export` and `reconstruct` share. The options hold once the command line is read.
void add_export_options(CLI::App& command, ExportOptions& options);

}  // namespace cairn::apps
