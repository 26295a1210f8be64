// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <functional>
#include <string>

#include "cli/command_tree.hpp"

namespace cairn::apps {

/// Adds --cell X,Y,Z, in the spelling of PLAN/cells.
CLI::Option* add_cell(CLI::App& command, std::function<void(const std::array<int, 3>&)> set_cell,
                      const std::string& description);

}  // namespace cairn::apps
