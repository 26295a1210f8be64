// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Names of version 0.1: accepted on the command line, and still written to JSON. Version 0.3 removes them.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace cairn::apps {

/// Replaces old commands, options and values by the current names, and prints a one-line note for each.
[[nodiscard]] std::vector<std::string> with_current_names(std::vector<std::string> arguments);

/// Adds a copy of each renamed field, under its old name, at all depths. For json and ordered_json.
template <class Json>
void add_old_fields(Json& json);

}  // namespace cairn::apps
